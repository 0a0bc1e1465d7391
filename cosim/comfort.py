"""Vibration at the seat: frequency weighting and figures of ISO 2631-1:1997."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Weighting:
    """Corner frequencies [Hz] and quality factors of a weighting, ISO 2631-1:1997 Table A.1.

    Band limits f1, f2; acceleration-velocity transition f3, f4, q4; upward step f5, q5, f6, q6
    (absent: None).
    """

    f3: float
    f4: float
    q4: float
    step: tuple[float, float, float, float] | None
    f1: float = 0.4
    f2: float = 100.0


WK: Final = Weighting(12.5, 12.5, 0.63, (2.37, 0.91, 3.35, 0.91))  # vertical, seated
WD: Final = Weighting(2.0, 2.0, 0.63, None)  # horizontal, seated


def weighting_response(
    weighting: Weighting, frequency: npt.ArrayLike
) -> npt.NDArray[np.complex128]:
    """Return H(f) of a weighting, ISO 2631-1:1997 Annex A, equations A.1 to A.4."""
    p = 2j * np.pi * np.asarray(frequency, dtype=np.float64)
    w = weighting
    w1, w2, w3, w4 = (2 * np.pi * f for f in (w.f1, w.f2, w.f3, w.f4))
    high = p * p / (p * p + np.sqrt(2) * w1 * p + w1 * w1)
    low = 1 / (1 + np.sqrt(2) * p / w2 + (p / w2) ** 2)
    transition = (1 + p / w3) / (1 + p / (w.q4 * w4) + (p / w4) ** 2)
    response = high * low * transition
    if w.step is not None:
        f5, q5, f6, q6 = w.step
        w5, w6 = 2 * np.pi * f5, 2 * np.pi * f6
        step = (1 + p / (q5 * w5) + (p / w5) ** 2) / (1 + p / (q6 * w6) + (p / w6) ** 2)
        response = response * step * (w5 / w6) ** 2
    return np.asarray(response, dtype=np.complex128)


def weighting_gain(weighting: Weighting, frequency: npt.ArrayLike) -> Array:
    """Return |H(f)| of a weighting."""
    return np.asarray(np.abs(weighting_response(weighting, frequency)), dtype=np.float64)


def weighted_rms(acceleration: Array, weighting: Weighting, rate_hz: float) -> float:
    """Return the frequency-weighted rms [m/s2] of a signal (n,), ISO 2631-1:1997 clause 6.4.2.

    The weighting is applied to the one-sided spectrum: at 100 Hz its band limit lies above Nyquist,
    where a digital filter would be off. The mean is removed first.
    """
    n = len(acceleration)
    spectrum = np.fft.rfft(acceleration - acceleration.mean())
    gain = weighting_gain(weighting, np.fft.rfftfreq(n, 1 / rate_hz))
    power = np.abs(spectrum * gain) ** 2
    power[1 : (n + 1) // 2] *= 2
    return float(np.sqrt(power.sum()) / n)


def vibration_dose(acceleration: Array, weighting: Weighting, rate_hz: float) -> float:
    """Return the fourth power vibration dose value [m/s^1.75] of a signal (n,), clause 6.3.2.

    The weighting is applied as in `weighted_rms`, its phase with it.
    """
    n = len(acceleration)
    spectrum = np.fft.rfft(acceleration - acceleration.mean())
    response = weighting_response(weighting, np.fft.rfftfreq(n, 1 / rate_hz))
    weighted = np.fft.irfft(spectrum * response, n)
    return float((np.sum(weighted**4) / rate_hz) ** 0.25)
