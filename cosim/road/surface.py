"""What a road's surface is, the even one, and how one grid is laid over another.

A surface gives elevations relative to the reference line on a grid of cross sections (s) and
columns (v, positive to the left), in m. All surfaces are frozen and fully described by their
fields, which is what the key of the road cache is made of.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final, Protocol

import numpy as np
import numpy.typing as npt

from cosim.road.track import DS

Floats = npt.NDArray[np.float64]
Grid = npt.NDArray[np.float32]

HALF_WIDTH: Final = 4.5  # of every road [m]
FINE_STEP: Final = DS / 2  # between cross sections where a road carries stones or obstacles [m]

# The road is even up to the first and fully uneven from the second on [m]
_FADE_START, _FADE_END = 3.0, 13.0
_QUANTUM = 2.0**-20  # elevations are multiples of it [m]: the same on every machine


class Surface(Protocol):
    """What a road needs to know of its surface."""

    @property
    def label(self) -> str:
        """A short name for file names."""

    @property
    def step(self) -> float:
        """Distance of the cross sections that carry it, `DS` or `FINE_STEP` [m]."""

    def columns(self, s: Floats) -> Floats:
        """Return the ascending v [m] of the grid's columns, shape (columns,)."""

    def elevation(self, s: Floats, v: Floats) -> Grid:
        """Return the elevation [m] at every (s, v), shape (len(s), len(v))."""


@dataclass(frozen=True)
class Smooth:
    """No unevenness at all."""

    label: ClassVar[str] = "smooth"
    step: ClassVar[float] = DS

    def columns(self, s: Floats) -> Floats:
        """Return the two edges [m]."""
        return np.array([-HALF_WIDTH, HALF_WIDTH])

    def elevation(self, s: Floats, v: Floats) -> Grid:
        """Return zeros [m], shape (len(s), len(v))."""
        return np.zeros((len(s), len(v)), dtype=np.float32)


def fade_in(s: Floats) -> Floats:
    """Return 0 to the start of the fade, 1 from its end on, without a kink in between."""
    t = np.clip((s - _FADE_START) / (_FADE_END - _FADE_START), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def quantised(elevation: Floats) -> Grid:
    """Return elevations [m] rounded to what every machine computes alike."""
    return np.asarray(np.round(elevation / _QUANTUM) * _QUANTUM, dtype=np.float32)


def finer_sections(s: Floats) -> Floats:
    """Return the cross sections `s` with one more in the middle of each two, (2 n - 1,) [m]."""
    finer = np.empty(2 * len(s) - 1)
    finer[::2] = s
    finer[1::2] = 0.5 * (s[1:] + s[:-1])
    return finer


def finer_grid(grid: Grid) -> Grid:
    """Return the elevations on `finer_sections`: a reader interpolates linearly, so it is the same
    surface.
    """
    finer = np.empty((2 * len(grid) - 1, grid.shape[1]), dtype=np.float32)
    finer[::2] = grid
    finer[1::2] = 0.5 * (grid[1:] + grid[:-1])
    return finer


def on_columns(grid: Grid, v: Floats, columns: Floats) -> Grid:
    """Return the elevations of `grid`, given at the columns `v`, at other `columns` between them.

    Readers interpolate linearly across, so it is the same surface where `columns` holds all of `v`.
    """
    right = np.clip(np.searchsorted(v, columns, "right") - 1, 0, len(v) - 2)
    share = np.clip((columns - v[right]) / (v[right + 1] - v[right]), 0.0, 1.0).astype(np.float32)
    return np.asarray(grid[:, right] * (1 - share) + grid[:, right + 1] * share)
