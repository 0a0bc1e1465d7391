"""Ride figures of a run: motions whose figures are known by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from cosim.comfort import WD, WK, weighting_gain
from cosim.metrics import COMFORT_FIGURES
from cosim.ride import Ride, ride_figures

Array = npt.NDArray[np.float64]

RATE = 100.0
NEEDED = ("seat", "travel", "load")


def ride(count: int = 2000) -> Ride:
    """One sine of 1 Hz in everything."""
    t = np.arange(count) / RATE
    sine, cosine = np.sin(2 * np.pi * t), np.cos(2 * np.pi * t)
    return Ride(
        seat=np.outer(sine, [0.3, 0.4, 0.5]),
        travel=0.02 + np.outer(sine, [0.01, 0.02, 0.03, 0.04]),
        load=6000.0 + np.outer(sine, [100.0, 200.0, 300.0, 400.0]),
        attitude=0.1 + np.outer(sine, [0.05, 0.02]),
        damper_force=np.outer(cosine, [100.0, 200.0, 300.0, 400.0]),
        damper_speed=np.outer(cosine, [0.1, 0.1, 0.2, 0.2]),
    )


def test_figures_of_a_run() -> None:
    found = ride_figures(ride(), RATE)
    assert set(found) == set(COMFORT_FIGURES)
    horizontal, vertical = (float(weighting_gain(w, 1.0)) for w in (WD, WK))
    amplitudes = np.array([0.3, 0.4, 0.5]) * [horizontal, horizontal, vertical]
    total = np.sqrt(np.square(amplitudes).sum() / 2)
    assert found["weighted_acceleration_m_s2"] == pytest.approx(total)
    assert found["weighted_vertical_m_s2"] == pytest.approx(amplitudes[2] / np.sqrt(2))
    dose = (np.power(amplitudes, 4).sum() * 3 / 8 * 20.0) ** 0.25
    assert found["vibration_dose_m_s1_75"] == pytest.approx(dose)
    over_all_wheels = np.sqrt(np.mean(np.square([1.0, 2.0, 3.0, 4.0]))) / np.sqrt(2)
    assert found["deflection_rms_m"] == pytest.approx(0.01 * over_all_wheels)
    assert found["tyre_load_rms_n"] == pytest.approx(100.0 * over_all_wheels)


def test_attitude_in_degrees_about_its_mean() -> None:
    found = ride_figures(ride(), RATE)
    for name, amplitude in (("roll", 0.05), ("pitch", 0.02)):
        expected = np.degrees(amplitude) / np.sqrt(2)
        assert found[f"{name}_rms_deg"] == pytest.approx(expected)
        assert found[f"{name}_rate_rms_deg_s"] == pytest.approx(2 * np.pi * expected, rel=2e-3)


def test_what_the_dampers_take_is_force_times_way() -> None:
    """20 s of F v / 2 at each."""
    power = (100 * 0.1 + 200 * 0.1 + 300 * 0.2 + 400 * 0.2) / 2
    assert ride_figures(ride(2001), RATE)["damper_energy_j"] == pytest.approx(20 * power, rel=1e-6)


def test_wheels_that_stand_differently_add_nothing() -> None:
    """About each wheel's own mean: static loads are not a ride."""
    one, stand = ride(), np.array([0.0, 1.0, -2.0, 3.0])
    shifted = replace(one, travel=one.travel + 0.01 * stand, load=one.load + 500.0 * stand)
    assert ride_figures(shifted, RATE) == pytest.approx(ride_figures(one, RATE))


@pytest.mark.parametrize("part", NEEDED)
def test_no_figures_without_the_signals_that_every_ride_needs(part: str) -> None:
    one = ride()
    getattr(one, part)[7, 0] = np.nan
    assert ride_figures(one, RATE) == {}


def test_other_signals_may_be_missing() -> None:
    one = ride()
    one.attitude[:], one.damper_force[:] = np.nan, np.nan
    left = {name for name in COMFORT_FIGURES if "roll" not in name and "pitch" not in name}
    assert set(ride_figures(one, RATE)) == left - {"damper_energy_j"}


def test_no_figures_of_less_than_two_seconds() -> None:
    assert ride_figures(ride(199), RATE) == {}
    assert ride_figures(ride(200), RATE) != {}
    assert ride_figures(ride(0), RATE) == {}
