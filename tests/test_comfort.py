"""Ride figures against ISO 2631-1: the printed table of weighting factors, and sines by hand."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from cosim.comfort import WD, WK, Weighting, ride_figures, weighted_rms, weighting_gain

Array = npt.NDArray[np.float64]

RATE = 100.0
TIME = np.arange(2000) / RATE

# ISO 2631-1:1997, Table 3: factors / 1000 at the nominal third-octave frequencies [Hz].
PRINTED = {
    "wk": (WK, {
        0.5: 418, 0.63: 459, 0.8: 477, 1.0: 482, 1.25: 484, 1.6: 494, 2.0: 531, 2.5: 631, 3.15: 804,
        4.0: 967, 5.0: 1039, 6.3: 1054, 8.0: 1036, 10.0: 988, 12.5: 902, 16.0: 768, 20.0: 636,
        25.0: 513, 31.5: 405,
    }),
    "wd": (WD, {
        0.5: 853, 0.63: 944, 0.8: 992, 1.0: 1011, 1.25: 1008, 1.6: 968, 2.0: 890, 2.5: 776,
        3.15: 642, 4.0: 512, 5.0: 409, 6.3: 323, 8.0: 253,
    }),
}  # fmt: skip


@pytest.mark.parametrize("name", PRINTED)
def test_factors_of_the_printed_table(name: str) -> None:
    weighting, table = PRINTED[name]
    for nominal, printed in table.items():
        exact = 10 ** (
            round(10 * np.log10(nominal)) / 10
        )  # the third octaves are tenths of a decade
        assert float(weighting_gain(weighting, exact)) == pytest.approx(printed / 1000, rel=0.01)


@pytest.mark.parametrize("weighting", [WK, WD], ids=["wk", "wd"])
def test_band_limits_and_a_constant(weighting: Weighting) -> None:
    gain = weighting_gain(weighting, np.array([0.0, 0.02, 0.1]))
    assert gain[0] == 0.0
    assert gain[1] < 0.005
    assert gain[2] == pytest.approx(gain[1] * 25, rel=0.05)  # 12 dB per octave


@pytest.mark.parametrize("weighting", [WK, WD], ids=["wk", "wd"])
@pytest.mark.parametrize("frequency", [0.5, 1.0, 4.5, 8.0, 20.0, 45.0])
def test_a_sine_of_whole_periods(weighting: Weighting, frequency: float) -> None:
    sine = 1.7 * np.sin(2 * np.pi * frequency * TIME + 0.3)
    expected = 1.7 / np.sqrt(2) * float(weighting_gain(weighting, frequency))
    assert weighted_rms(sine, weighting, RATE) == pytest.approx(expected, rel=1e-9)


def test_powers_of_sines_add_up_and_a_mean_does_not_count() -> None:
    parts = [a * np.sin(2 * np.pi * f * TIME) for a, f in ((0.5, 1.0), (0.8, 5.0), (0.3, 12.0))]
    separate = [weighted_rms(part, WK, RATE) for part in parts]
    together = weighted_rms(9.81 + np.sum(parts, axis=0), WK, RATE)
    assert together == pytest.approx(np.sqrt(np.sum(np.square(separate))))


def test_an_odd_number_of_samples_and_the_highest_frequency() -> None:
    """The spectrum has no middle bin then; with an even number it counts once."""
    odd = TIME[:1999]
    sine = np.sin(2 * np.pi * 5.0 * odd)
    expected = float(weighting_gain(WK, 5.0)) / np.sqrt(2)
    assert weighted_rms(sine, WK, RATE) == pytest.approx(expected, rel=2e-3)
    alternating = np.where(np.arange(2000) % 2, 1.0, -1.0)
    assert weighted_rms(alternating, WK, RATE) == pytest.approx(float(weighting_gain(WK, 50.0)))


def test_the_rate_is_that_of_the_signal() -> None:
    at_200 = np.sin(2 * np.pi * 5.0 * np.arange(4000) / 200.0)
    at_100 = np.sin(2 * np.pi * 5.0 * TIME)
    assert weighted_rms(at_200, WK, 200.0) == pytest.approx(weighted_rms(at_100, WK, 100.0))


def signals(count: int = 2000) -> tuple[Array, Array, Array]:
    """Seat, travel and load of known rms."""
    t = np.arange(count) / RATE
    sine = np.sin(2 * np.pi * 1.0 * t)
    seat = np.column_stack([0.3 * sine, 0.4 * sine, 0.5 * sine])
    travel = 0.02 + np.outer(sine, [0.01, 0.02, 0.03, 0.04])
    load = 6000.0 + np.outer(sine, [100.0, 200.0, 300.0, 400.0])
    return seat, travel, load


def test_figures_of_a_run() -> None:
    found = ride_figures(*signals(), RATE)
    horizontal, vertical = (float(weighting_gain(w, 1.0)) / np.sqrt(2) for w in (WD, WK))
    total = np.sqrt((0.3**2 + 0.4**2) * horizontal**2 + 0.5**2 * vertical**2)
    assert found["weighted_acceleration_m_s2"] == pytest.approx(total)
    over_all_wheels = np.sqrt(np.mean(np.square([1.0, 2.0, 3.0, 4.0]))) / np.sqrt(2)
    assert found["deflection_rms_m"] == pytest.approx(0.01 * over_all_wheels)
    assert found["tyre_load_rms_n"] == pytest.approx(100.0 * over_all_wheels)
    assert len(found) == 3


def test_wheels_that_stand_differently_add_nothing() -> None:
    """About each wheel's own mean: static loads are not a ride."""
    seat, travel, load = signals()
    stand = np.array([0.0, 1.0, -2.0, 3.0])
    shifted = ride_figures(seat, travel + 0.01 * stand, load + 500.0 * stand, RATE)
    assert shifted == pytest.approx(ride_figures(seat, travel, load, RATE))


@pytest.mark.parametrize("part", [0, 1, 2])
def test_no_figures_without_signals_or_with_too_few(part: int) -> None:
    seat, travel, load = signals()
    (seat, travel, load)[part][7, 0] = np.nan
    assert ride_figures(seat, travel, load, RATE) == {}
    assert ride_figures(*signals(199), RATE) == {}
    assert ride_figures(*signals(200), RATE) != {}
    assert ride_figures(*signals(0), RATE) == {}
