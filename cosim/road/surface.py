"""Unevenness of the road surface: none, random after ISO 8608, or bumps.

A surface gives elevations relative to the reference line on a grid of cross sections (the
track's s) and columns (v, positive to the left), in m. All are frozen and fully described by
their fields, which is what the key of the road cache is made of.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from cosim.errors import did_you_mean
from cosim.road.errors import RoadError

Floats = npt.NDArray[np.float64]

HALF_WIDTH = 4.5  # of every road [m]
_TRACKS = np.concatenate(([-4.5, -3.2, -2.2, -1.6], np.linspace(-1.2, -0.4, 9)))  # wheels +-.35 m
_WHEEL_COLUMNS = np.round(np.concatenate((_TRACKS, [0.0], -_TRACKS[::-1])), 3)
_DENSE_COLUMNS = np.round(np.linspace(-HALF_WIDTH, HALF_WIDTH, 91), 3)
_MOST_CELLS = 2_400_000  # of a grid that is dense over its whole width (10 MB)

REFERENCE_FREQUENCY = 0.1  # n0 [cycles/m]
LOWEST_FREQUENCY = 0.011  # ISO 8608's range, before the tyre's patch filters it [cycles/m]
HIGHEST_FREQUENCY = 10.0
ROUGHNESS = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6}  # Gd(n0), geometric mean [m3]
# Between lines T apart: gamma = [1 + (2 pi n T / Wp)^w]^-p with w = 2; (Wp, p) by class
_COHERENCE = {"A": (8.5, 3.5), "B": (5.3, 2.2), "C": (3.0, 1.3), "D": (1.6, 0.8)}

# The road is even up to the first and fully rough from the second on [m]
_FADE_START, _FADE_END = 3.0, 13.0
_QUANTUM = 2.0**-20  # elevations are multiples of it [m]: the same on every machine
_CORRELATIONS_AT_ONCE = 2_000_000  # of all frequencies and pairs of columns: 16 MB


class Surface(Protocol):
    """What a road needs to know of its surface."""

    def columns(self, s: Floats) -> Floats:
        """Return the ascending v [m] of the grid's columns, shape (columns,)."""

    def elevation(self, s: Floats, v: Floats) -> npt.NDArray[np.float32]:
        """Return the elevation [m] at every (s, v), shape (len(s), len(v))."""

    @property
    def label(self) -> str:
        """A short name for file names."""


@dataclass(frozen=True)
class Smooth:
    """No unevenness at all."""

    label: ClassVar[str] = "smooth"

    def columns(self, s: Floats) -> Floats:
        """Return the two edges [m]."""
        return np.array([-HALF_WIDTH, HALF_WIDTH])

    def elevation(self, s: Floats, v: Floats) -> npt.NDArray[np.float32]:
        """Return zeros [m], shape (len(s), len(v))."""
        return np.zeros((len(s), len(v)), dtype=np.float32)


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

    def elevation(self, s: Floats, v: Floats) -> npt.NDArray[np.float32]:
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
        field = np.fft.irfft(spectrum, count, axis=0)[: len(s)] * _fade_in(s)[:, None]
        return np.asarray(np.round(field / _QUANTUM) * _QUANTUM, dtype=np.float32)

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
        n = frequency[:, None, None]
        coherence = self.coherence(n, np.abs(v[:, None] - v))
        coherence += 1e-9 * np.eye(len(v))  # long waves: columns all but equal
        factor = np.linalg.cholesky(coherence)
        white = random.standard_normal((len(frequency), len(v), 2))  # real and imaginary parts
        roughness = ROUGHNESS[self.road_class] * (frequency / REFERENCE_FREQUENCY) ** -2.0
        along = 2.0 / 3.0 + np.cos(2.0 * np.pi * frequency * ds) / 3.0
        across = 2.0 / 3.0 + self.coherence(frequency, np.asarray(np.diff(v).min())) / 3.0
        scale = np.sqrt(roughness / (along * across))
        mixed = (factor @ white) @ np.array([1.0, 1.0j])
        return np.asarray(mixed * scale[:, None])


@dataclass(frozen=True)
class Bumps:
    """Cosine bumps across one side of the road, left and right in turn.

    `height` and `length` [m] are those of a bump; `spacing` [m] is from one bump to the next on the
    same side, and the right-hand bumps stand half of it behind the left-hand ones.
    """

    height: float
    length: float
    spacing: float

    _first: ClassVar[float] = 15.0  # start of the first bump [m]
    _inner: ClassVar[float] = 0.3  # nearer to the middle a bump falls off to nothing [m]

    def __post_init__(self) -> None:
        for name in ("height", "length", "spacing"):
            if not getattr(self, name) > 0.0:
                value = getattr(self, name)
                raise RoadError(f"the bumps' {name} is {value:g} m; it must be positive")
        if self.spacing < self.length:
            raise RoadError(
                f"the bumps' spacing of {self.spacing:g} m is less than "
                f"their length of {self.length:g} m"
            )

    @property
    def label(self) -> str:
        """For example bumps-0.03x0.5x4."""
        return f"bumps-{self.height:g}x{self.length:g}x{self.spacing:g}"

    def columns(self, s: Floats) -> Floats:
        """Return the edges, the middle and the bumps' inner ends [m]."""
        return np.array([-HALF_WIDTH, -self._inner, 0.0, self._inner, HALF_WIDTH])

    def elevation(self, s: Floats, v: Floats) -> npt.NDArray[np.float32]:
        """Return the bumps [m], shape (len(s), len(v))."""
        left, right = (self._one_side(s, start) for start in (0.0, 0.5 * self.spacing))
        on_left = np.clip(v / self._inner, 0.0, 1.0)
        on_right = np.clip(-v / self._inner, 0.0, 1.0)
        return np.asarray(np.outer(left, on_left) + np.outer(right, on_right), dtype=np.float32)

    def _one_side(self, s: Floats, start: float) -> Floats:
        ahead = s - self._first - start
        place = np.mod(ahead, self.spacing)
        wave = 0.5 * self.height * (1.0 - np.cos(2.0 * np.pi * place / self.length))
        return np.where((ahead >= 0.0) & (place < self.length), wave, 0.0)


def surface_key(surface: Surface) -> str:
    """Return a hash of all that the surface is made from."""
    columns = _WHEEL_COLUMNS.tobytes() + _DENSE_COLUMNS.tobytes()
    return hashlib.sha256(repr(surface).encode() + columns).hexdigest()


def _fade_in(s: Floats) -> Floats:
    """Return 0 to the start of the fade, 1 from its end on, without a kink in between."""
    t = np.clip((s - _FADE_START) / (_FADE_END - _FADE_START), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


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
