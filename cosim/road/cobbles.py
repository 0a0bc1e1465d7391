"""Cobblestones: rows of setts across the road, each of its own height, on an uneven bed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple

import numpy as np

from cosim.road.errors import RoadError
from cosim.road.iso8608 import Iso8608
from cosim.road.surface import (
    FINE_STEP,
    HALF_WIDTH,
    Floats,
    Grid,
    fade_in,
    finer_grid,
    on_columns,
    quantised,
)

_BAND = np.linspace(0.4, 1.2, 21)  # below the wheels: a column every 0.04 m
_SIDE = np.concatenate((_BAND, [1.6, 2.2, 3.2, HALF_WIDTH]))
_WHEEL_COLUMNS = np.round(np.concatenate((-_SIDE[::-1], [0.0], _SIDE)), 3)
_DENSE_COLUMNS = np.round(np.linspace(-HALF_WIDTH, HALF_WIDTH, 226), 3)
_MOST_CELLS: Final = 5_000_000  # of a grid that is dense over its whole width (20 MB)

SMALLEST_STONE: Final = 4 * FINE_STEP
LARGEST_STONE: Final = 0.5
_SPREAD_ALONG: Final = 0.06  # of the rows' lengths and of the stones' widths, to either side
_SPREAD_ACROSS: Final = 0.15
_TILT: Final = 0.5  # of a stone at its edges, in standard deviations of the height
_MEAN_OF_CROWN: Final = 4.0 / 9.0  # of (1 - x^2)(1 - y^2) over a stone


class _Stones(NamedTuple):
    """The setts row by row: `start` (rows,) and `length` (rows,) along, `edge` (rows, stones)
    across, `height` and both `tilts` (rows, stones), all in m.
    """

    start: Floats
    length: Floats
    edge: Floats
    height: Floats
    tilt_along: Floats
    tilt_across: Floats


@dataclass(frozen=True)
class Cobbles:
    """Setts laid in rows across the road on a bed with the spectrum of an ISO 8608 class.

    `along` and `across` [m] are the mean size of a stone with its joint, `height` the standard
    deviation of the stones' heights [m], `crown` how far the tread sinks from the middle of a stone
    to the joints [m]. Each stone also tilts both ways. Sizes and joints are those of large setts
    (EN 1342 and DIN 18318: 120 to 220 mm, joints 8 to 15 mm, dressed faces flat to some
    millimetres); heights and bed are design values.
    """

    seed: int
    along: float = 0.16
    across: float = 0.18
    height: float = 0.003
    crown: float = 0.006
    road_class: str = "C"

    step: ClassVar[float] = FINE_STEP

    def __post_init__(self) -> None:
        Iso8608(self.road_class, self.seed)
        for name, size in (("length", self.along), ("width", self.across)):
            if not SMALLEST_STONE - 1e-9 <= size <= LARGEST_STONE:
                raise RoadError(
                    f"the stones' {name} is {size:g} m; the road's grid carries "
                    f"{SMALLEST_STONE:g} m to {LARGEST_STONE:g} m"
                )
        for name, size in (("height", self.height), ("crown", self.crown)):
            if size < 0.0:
                raise RoadError(f"the stones' {name} is {size:g} m; it must not be negative")

    @property
    def label(self) -> str:
        """For example cobbles-c-7."""
        return f"cobbles-{self.road_class.lower()}-{self.seed}"

    def columns(self, s: Floats) -> Floats:
        """Return columns 0.04 m apart [m], on a long road only where the wheels run."""
        short = len(s) * len(_DENSE_COLUMNS) <= _MOST_CELLS
        return np.array(_DENSE_COLUMNS if short else _WHEEL_COLUMNS, dtype=np.float64)

    def elevation(self, s: Floats, v: Floats) -> Grid:
        """Return bed and stones [m] at cross sections `FINE_STEP` apart, (len(s), len(v))."""
        bed, coarse = Iso8608(self.road_class, self.seed), s[::2]
        places = bed.columns(coarse)
        grid = on_columns(finer_grid(bed.elevation(coarse, places)), places, v)[: len(s)]
        return quantised(grid + self.stones(s, v) * fade_in(s)[:, None])

    def stones(self, s: Floats, v: Floats) -> Floats:
        """Return the stones alone [m], of mean 0, shape (len(s), len(v))."""
        stones = self._laid(float(s[0]), float(s[-1]))
        row = np.searchsorted(stones.start, s, "right") - 1
        x = 2.0 * (s - stones.start[row]) / stones.length[row] - 1.0
        rows = np.arange(len(stones.start))
        field = np.empty((len(s), len(v)))
        for j, place in enumerate(v.tolist()):
            stone = np.count_nonzero(stones.edge <= place, axis=1) - 1
            left, right = stones.edge[rows, stone], stones.edge[rows, stone + 1]
            y = (2.0 * (place - left) / (right - left) - 1.0)[row]
            middle, along, across = (
                q[rows, stone][row] for q in (stones.height, stones.tilt_along, stones.tilt_across)
            )
            crown = self.crown * ((1.0 - x * x) * (1.0 - y * y) - _MEAN_OF_CROWN)
            field[:, j] = middle + along * x + across * y + crown
        return field

    def _laid(self, first: float, last: float) -> _Stones:
        """Lay the rows from `first` to `last` [m], each with its own joints."""
        random = np.random.default_rng([self.seed, 1])
        count = int((last - first) / (self.along * (1.0 - _SPREAD_ALONG))) + 2
        length = self.along * (1.0 + _SPREAD_ALONG * random.uniform(-1.0, 1.0, count))
        start = first + np.concatenate(([0.0], np.cumsum(length)[:-1]))
        in_row = int(2.0 * HALF_WIDTH / (self.across * (1.0 - _SPREAD_ACROSS))) + 3
        width = self.across * (1.0 + _SPREAD_ACROSS * random.uniform(-1.0, 1.0, (count, in_row)))
        begin = -HALF_WIDTH - width[:, :1] * random.random((count, 1))
        edge = np.concatenate((begin, begin + np.cumsum(width, axis=1)), axis=1)
        height, along, across = self.height * random.standard_normal((3, count, in_row))
        return _Stones(start, length, edge, height, _TILT * along, _TILT * across)
