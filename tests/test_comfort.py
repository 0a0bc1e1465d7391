"""Ride figures against ISO 2631-1: the printed table of weighting factors, and sines by hand."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scipy import signal

from cosim.comfort import (
    WD,
    WK,
    Weighting,
    vibration_dose,
    weighted_rms,
    weighting_gain,
)

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


# ---------------------------------------------------------------- dose values


@pytest.mark.parametrize("weighting", [WK, WD], ids=["wk", "wd"])
@pytest.mark.parametrize("frequency", [1.0, 5.0, 20.0])
def test_the_dose_of_a_sine(weighting: Weighting, frequency: float) -> None:
    """The mean of sin^4 is 3 / 8."""
    sine = 1.7 * np.sin(2 * np.pi * frequency * TIME)
    amplitude = 1.7 * float(weighting_gain(weighting, frequency))
    expected = amplitude * (3 / 8 * 20.0) ** 0.25
    assert vibration_dose(sine, weighting, RATE) == pytest.approx(expected, rel=1e-6)


def test_the_dose_grows_with_the_fourth_root_of_time_and_knows_peaks() -> None:
    noise = np.random.default_rng(3).standard_normal(20_000)
    short, long = (vibration_dose(np.tile(noise, n), WK, RATE) for n in (1, 16))
    assert long == pytest.approx(2 * short, rel=1e-3)
    bump = np.zeros(20_000)
    bump[1000:1010] = 30.0
    as_rms = noise * weighted_rms(bump, WK, RATE) / weighted_rms(noise, WK, RATE)
    assert vibration_dose(bump, WK, RATE) > 2 * vibration_dose(as_rms, WK, RATE)


def test_the_weighted_signal_is_that_of_analogue_filters() -> None:
    """The dose needs the phase too: SciPy's state-space simulation of the same transfer functions,
    at 4 kHz, where holding the input matters no more.
    """
    rate, w = 4000.0, WK
    f = np.arange(0, 8, 1 / rate)
    pulse = np.exp(-(((f - 2.0) / 0.05) ** 2))
    w1, w2, w3, w4 = (2 * np.pi * x for x in (w.f1, w.f2, w.f3, w.f4))
    assert w.step is not None
    f5, q5, f6, q6 = w.step
    w5, w6 = 2 * np.pi * f5, 2 * np.pi * f6
    parts = [
        ([1, 0, 0], [1, np.sqrt(2) * w1, w1**2]),
        ([w2**2], [1, np.sqrt(2) * w2, w2**2]),
        ([1 / w3, 1], [1 / w4**2, 1 / (w.q4 * w4), 1]),
        ([1 / w5**2, 1 / (q5 * w5), 1], [1 / w6**2, 1 / (q6 * w6), 1]),
    ]
    weighted = pulse
    for numerator, denominator in parts:
        weighted = signal.lsim((numerator, denominator), weighted, f)[1]
    expected = (np.sum((weighted * (w5 / w6) ** 2) ** 4) / rate) ** 0.25
    assert vibration_dose(pulse, WK, rate) == pytest.approx(expected, rel=0.01)
