"""A random road surface with the spectrum of an ISO 8608 class."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
import numpy.typing as npt

from cosim.errors import did_you_mean
from cosim.road.errors import RoadError
from cosim.road.surface import HALF_WIDTH, Floats, Grid, fade_in, quantised
from cosim.road.track import DS

_TRACKS = np.concatenate(([-4.5, -3.2, -2.2, -1.6], np.linspace(-1.2, -0.4, 9)))  # wheels +-.35 m
_WHEEL_COLUMNS = np.round(np.concatenate((_TRACKS, [0.0], -_TRACKS[::-1])), 3)
_DENSE_COLUMNS = np.round(np.linspace(-HALF_WIDTH, HALF_WIDTH, 91), 3)
_MOST_CELLS = 2_400_000  # of a grid that is dense over its whole width (10 MB)

REFERENCE_FREQUENCY: Final = 0.1  # n0 [cycles/m]
LOWEST_FREQUENCY: Final = 0.011  # ISO 8608's range, before the patch filters it [cycles/m]
HIGHEST_FREQUENCY: Final = 10.0
ROUGHNESS: Final = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6}  # Gd(n0), mean [m3]
# Between lines T apart: gamma = [1 + (2 pi n T / Wp)^w]^-p with w = 2; (Wp, p) by class
_COHERENCE = {"A": (8.5, 3.5), "B": (5.3, 2.2), "C": (3.0, 1.3), "D": (1.6, 0.8)}

_CORRELATIONS_AT_ONCE = 2_000_000  # of all frequencies and pairs of columns: 16 MB


@dataclass(frozen=True)
class Iso8608:
    """One Gaussian field over (s, v) with the spectrum of an ISO 8608 class, A to D.

    Along s its displacement spectrum is Gd(n) = Gd(n0) (n / n0)^-2 between 0.011 and 10 cycles/m;
    across, two lines T apart have the coherence of `coherence`, frequency by frequency. Front and
    rear wheels thus meet the same road, and what a wheel meets hardly depends on where between the
    columns it runs.
    """

    road_class: str
    seed: int

    step: ClassVar[float] = DS

    def __post_init__(self) -> None:
        if self.road_class not in ROUGHNESS:
            hint = did_you_mean(self.road_class, ROUGHNESS)
            raise RoadError(f"road class '{self.road_class}' is not one of A, B, C, D{hint}")
        if self.seed < 0:
            raise RoadError(f"the surface's seed is {self.seed}; it must not be negative")

    @property
    def label(self) -> str:
        """For example iso8608-b-7."""
        return f"iso8608-{self.road_class.lower()}-{self.seed}"

    def columns(self, s: Floats) -> Floats:
        """Return columns 0.1 m apart [m], on a long road only where the wheels run."""
        short = len(s) * len(_DENSE_COLUMNS) <= _MOST_CELLS
        return np.array(_DENSE_COLUMNS if short else _WHEEL_COLUMNS, dtype=np.float64)

    def elevation(self, s: Floats, v: Floats) -> Grid:
        """Return the field [m], faded in behind s = 0, shape (len(s), len(v))."""
        count, ds = _fast_length(len(s)), float(s[1] - s[0])
        spectrum = np.zeros((count // 2 + 1, len(v)), dtype=np.complex128)
        frequency = np.arange(count // 2 + 1) / (count * ds)
        (used,) = np.nonzero((frequency >= LOWEST_FREQUENCY) & (frequency < HIGHEST_FREQUENCY))
        random = np.random.default_rng(self.seed)
        at_once = max(1, _CORRELATIONS_AT_ONCE // len(v) ** 2)
        for first in range(0, len(used), at_once):
            rows = used[first : first + at_once]
            spectrum[rows] = self._amplitudes(random, frequency[rows], v, ds)
        # a bin holds Gd dn; irfft divides by the count
        spectrum *= count * np.sqrt(0.25 / (count * ds))
        field = np.fft.irfft(spectrum, count, axis=0)[: len(s)] * fade_in(s)[:, None]
        return quantised(field)

    def coherence(self, frequency: Floats, distance: Floats) -> Floats:
        """Return gamma of lines `distance` [m] apart at `frequency` [cycles/m], broadcast."""
        corner, power = _COHERENCE[self.road_class]
        turn = 2.0 * np.pi * frequency * distance / corner
        return np.asarray((1.0 + turn * turn) ** -power)

    def _amplitudes(
        self, random: np.random.Generator, frequency: Floats, v: Floats, ds: float
    ) -> npt.NDArray[np.complex128]:
        """Return complex amplitudes of variance 2 Gd, shape (len(frequency), len(v)).

        The Cholesky factor of the coherences between all columns mixes independent amplitudes.
        Wheels run between the grid's points, where linear interpolation takes away from the short
        waves: averaged over the places between two points of coherence g, the power (1 - f)^2 + f^2
        + 2 f (1 - f) g leaves 2/3 + g/3. The amplitudes are raised by as much, so that a wheel
        meets the class on average.
        """
        apart = np.abs(v[:, None] - v).round(6)
        distances, pair = np.unique(apart, return_inverse=True)
        coherence = self.coherence(frequency[:, None], distances)[:, pair.reshape(len(v), len(v))]
        coherence += 1e-9 * np.eye(len(v))  # long waves: columns all but equal
        factor = np.linalg.cholesky(coherence)
        white = random.standard_normal((len(frequency), len(v), 2))  # real and imaginary parts
        roughness = ROUGHNESS[self.road_class] * (frequency / REFERENCE_FREQUENCY) ** -2.0
        along = 2.0 / 3.0 + np.cos(2.0 * np.pi * frequency * ds) / 3.0
        across = 2.0 / 3.0 + self.coherence(frequency, np.asarray(np.diff(v).min())) / 3.0
        scale = np.sqrt(roughness / (along * across))
        mixed = (factor @ white) @ np.array([1.0, 1.0j])
        return np.asarray(mixed * scale[:, None])


def _fast_length(count: int) -> int:
    """Return the next even length with no prime factor above 5, which is fast to transform."""
    length = count + count % 2
    while True:
        rest = length
        for factor in (2, 3, 5):
            while rest % factor == 0:
                rest //= factor
        if rest == 1:
            return length
        length += 2
