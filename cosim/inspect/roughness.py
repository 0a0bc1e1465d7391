"""The unevenness of a road as ISO 8608 counts it: Gd(n) = Gd(n0) (n / n0)^-w, n0 = 0.1 cycles/m."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

N0: Final = 0.1  # cycles/m
LOWEST: Final = 0.011  # cycles/m; ISO 8608, clause 5.1.1
HIGHEST: Final = 2.83
LIMITS: Final = {  # upper bound of Gd(n0) [m3], ISO 8608, table C.1
    "A": 32e-6, "B": 128e-6, "C": 512e-6, "D": 2048e-6, "E": 8192e-6, "F": 32768e-6, "G": 131072e-6,
}  # fmt: skip
SEGMENT: Final = 400.0  # m, over which a spectrum is taken on a long road
_PER_DECADE: Final = 12  # bands of frequencies
_ENOUGH: Final = 12  # frequencies in a band, beyond which its level is no surer
LEAST_OCTAVES: Final = 2.0


@dataclass(frozen=True)
class Roughness:
    """Gd(n0) [m3] of a fit with w = 2, by which classes are told, the waviness w of a free fit, and
    the range of the fit [cycles/m].
    """

    gd: float
    waviness: float
    low: float
    high: float

    @property
    def road_class(self) -> str:
        """The letter from A to H."""
        return next((name for name, limit in LIMITS.items() if self.gd < limit), "H")


def roughness(lines: Floats, step: float) -> Roughness | None:
    """Fit the spectrum of elevations (lines, points) [m] at points `step` [m] apart.

    None for a road too short for two octaves, or without any unevenness.
    """
    count = lines.shape[1]
    size = min(count, max(round(SEGMENT / step), count // 8))
    low, high = max(LOWEST, 3.0 / (size * step)), min(HIGHEST, 0.25 / step)
    if high <= low * 2**LEAST_OCTAVES:
        return None
    frequency, power = _spectrum(lines, step, size)
    used, mean, weight = _bands(frequency, power, low, high)
    if len(used) < 4 or not mean.min() > 1e-16:
        return None
    x, y = np.log10(used / N0), np.log10(mean)
    waviness = -float(np.polyfit(x, y, 1, w=np.sqrt(weight))[0])
    gd = 10 ** float(np.average(y + 2.0 * x, weights=weight))
    return Roughness(gd, waviness, float(low), float(high))


def _spectrum(lines: Floats, step: float, size: int) -> tuple[Floats, Floats]:
    """Return frequencies [cycles/m] and one-sided density [m3], the mean over lines and segments.

    Welch's method: Hann windows of `size` points that overlap by half, each segment without its own
    straight line. Written out, since SciPy's signal package takes a second to import.
    """
    window = np.hanning(size + 1)[:-1]
    starts = range(0, lines.shape[1] - size + 1, max(1, size // 2))
    place = np.arange(size) - 0.5 * (size - 1)
    total = np.zeros(size // 2 + 1)
    for start in starts:
        part = lines[:, start : start + size]
        part = part - part.mean(axis=1, keepdims=True)
        part = part - (part @ place / (place @ place))[:, None] * place
        total += (np.abs(np.fft.rfft(part * window, axis=1)) ** 2).mean(axis=0)
    density = 2.0 * total * step / (len(starts) * (window @ window))
    density[0] *= 0.5
    return np.asarray(np.fft.rfftfreq(size, step)), density


def _bands(
    frequency: Floats, power: Floats, low: float, high: float
) -> tuple[Floats, Floats, Floats]:
    """Return middle, level and weight of each band: long waves are few and their level uncertain.

    The level is that at the middle, as if the spectrum fell with w = 2 within the band.
    """
    edges = np.geomspace(low, high, max(4, round(_PER_DECADE * np.log10(high / low))) + 1)
    which = np.digitize(frequency, edges) - 1
    bands = [which == b for b in range(len(edges) - 1) if np.any(which == b)]
    middle = np.array([10 ** np.mean(np.log10(frequency[band])) for band in bands])
    level = [
        np.mean(power[band] * (frequency[band] / m) ** 2)
        for band, m in zip(bands, middle, strict=True)
    ]
    weight = [min(np.count_nonzero(band), _ENOUGH) for band in bands]
    return middle, np.array(level), np.array(weight, dtype=float)
