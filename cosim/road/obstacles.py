"""Obstacles laid over any surface: alternating bumps, a hump, a pothole.

They are sampled on cross sections `FINE_STEP` apart, and the grid has a column wherever one of them
has a corner across the road. What is too short for that is refused. Heights of obstacles that meet
add up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal, Protocol

import numpy as np

from cosim.road.errors import RoadError
from cosim.road.surface import FINE_STEP, HALF_WIDTH, Floats

Side = Literal["left", "right", "both"]

SHORTEST_WAVE: Final = 8 * FINE_STEP  # of a cosine: its top is met to within 4 % [m]
SHORTEST_SLOPE: Final = 2 * FINE_STEP  # of an edge or a bottom [m]
FIRST_PLACE: Final = 3.0  # the car starts on the road before it [m]
WHEEL_PATH: Final = 0.81  # the wheels' mean distance from the reference line [m]
_INNER: Final = 0.3  # nearer to the middle a one-sided bump falls off to nothing [m]


class Obstacle(Protocol):
    """What a road needs to know of an obstacle."""

    @property
    def name(self) -> str:
        """What it is, in a message."""

    @property
    def end(self) -> float:
        """Where it is over [m]; infinite where it goes on to the end of the road."""

    def columns(self) -> tuple[float, ...]:
        """Return the v [m] of its corners across the road."""

    def elevation(self, s: Floats, v: Floats) -> Floats:
        """Return what it adds [m] at every (s, v), shape (len(s), len(v))."""


@dataclass(frozen=True)
class Bumps:
    """Cosine bumps across one half of the road, left and right in turn, from `first` to `last`.

    `height` and `length` [m] are those of a bump; `spacing` [m] is from one bump to the next on the
    same side, and the right-hand bumps stand half of it behind the left-hand ones. A bump that
    would pass `last` is left out.
    """

    height: float
    length: float
    spacing: float
    first: float = 15.0
    last: float = np.inf

    def __post_init__(self) -> None:
        _positive(self.name, height=self.height, length=self.length, spacing=self.spacing)
        _check_wave(self.name, self.length)
        _check_place(self.name, self.first)
        if self.spacing < self.length:
            raise RoadError(
                f"the bumps' spacing of {self.spacing:g} m is less than "
                f"their length of {self.length:g} m"
            )
        if self.last < self.first + self.length:
            raise RoadError(
                f"there is no room for a bump of {self.length:g} m between "
                f"{self.first:g} m and {self.last:g} m"
            )

    @property
    def name(self) -> str:
        """What it is."""
        return "row of bumps"

    @property
    def end(self) -> float:
        """Where the last bump may end [m]."""
        return self.last

    def columns(self) -> tuple[float, ...]:
        """Return the middle and the bumps' inner ends [m]."""
        return (-_INNER, 0.0, _INNER)

    def elevation(self, s: Floats, v: Floats) -> Floats:
        """Return the bumps [m], shape (len(s), len(v))."""
        left, right = (self._one_side(s, start) for start in (0.0, 0.5 * self.spacing))
        return np.asarray(np.outer(left, _half(v)) + np.outer(right, _half(-v)))

    def _one_side(self, s: Floats, start: float) -> Floats:
        ahead = s - self.first - start
        place = np.mod(ahead, self.spacing)
        whole = (ahead >= 0.0) & (s - place + self.length <= self.last)
        return np.where(whole & (place < self.length), _cosine(place, self.length, self.height), 0)


@dataclass(frozen=True)
class Hump:
    """One cosine bump of `height` and `length` [m] from `place` [m] on: across the whole road as a
    speed hump, or across one half of it. A negative height is a dip.
    """

    place: float
    height: float
    length: float
    side: Side = "both"

    def __post_init__(self) -> None:
        _positive(self.name, length=self.length)
        if self.height == 0.0:
            raise RoadError("the hump's height is 0 m; leave the hump out")
        _check_wave(self.name, self.length)
        _check_place(self.name, self.place)

    @property
    def name(self) -> str:
        """What it is."""
        return "hump"

    @property
    def end(self) -> float:
        """Where it is over [m]."""
        return self.place + self.length

    def columns(self) -> tuple[float, ...]:
        """Return its inner end [m], none where it spans the road."""
        return () if self.side == "both" else (-_INNER, 0.0, _INNER)

    def elevation(self, s: Floats, v: Floats) -> Floats:
        """Return the hump [m], shape (len(s), len(v))."""
        on = (s >= self.place) & (s <= self.end)
        wave = np.where(on, _cosine(s - self.place, self.length, self.height), 0.0)
        return np.asarray(np.outer(wave, _across(self.side, _half, v)))


@dataclass(frozen=True)
class Pothole:
    """A hole of `depth` [m] with a flat bottom and sloped edges, below the wheels of one side or
    both.

    It is `length` m long from `place` on and `width` m wide around `offset` m beside the reference
    line; the edges, `edge` m wide, lie within. A negative depth is a raised plate.
    """

    place: float
    depth: float
    length: float
    width: float
    side: Side = "both"
    edge: float = 0.1
    offset: float = WHEEL_PATH

    def __post_init__(self) -> None:
        _positive(self.name, length=self.length, width=self.width)
        if self.depth == 0.0:
            raise RoadError("the pothole's depth is 0 m; leave the pothole out")
        if self.edge < SHORTEST_SLOPE:
            raise RoadError(
                f"the pothole's edge is {self.edge:g} m wide; the road's grid resolves "
                f"{SHORTEST_SLOPE:g} m or more"
            )
        for name, size in (("length", self.length), ("width", self.width)):
            if size < 2.0 * self.edge + SHORTEST_SLOPE - 1e-9:
                raise RoadError(
                    f"the pothole's {name} of {size:g} m is too small: two edges of "
                    f"{self.edge:g} m and a bottom of {SHORTEST_SLOPE:g} m need "
                    f"{2.0 * self.edge + SHORTEST_SLOPE:g} m"
                )
        inner, outer = self.offset - 0.5 * self.width, self.offset + 0.5 * self.width
        if inner < 0.0 or outer > HALF_WIDTH:
            raise RoadError(
                f"the pothole reaches from {inner:g} m to {outer:g} m beside the middle; it must "
                f"stay between 0 m and the road's edge at {HALF_WIDTH:g} m"
            )
        _check_place(self.name, self.place)

    @property
    def name(self) -> str:
        """What it is."""
        return "pothole"

    @property
    def end(self) -> float:
        """Where it is over [m]."""
        return self.place + self.length

    def columns(self) -> tuple[float, ...]:
        """Return the corners of its cross section [m]."""
        half = 0.5 * self.width
        corners = [self.offset + q for q in (-half, -half + self.edge, half - self.edge, half)]
        left = corners if self.side != "right" else []
        right = [-q for q in corners] if self.side != "left" else []
        return (*left, *right)

    def elevation(self, s: Floats, v: Floats) -> Floats:
        """Return the hole [m], shape (len(s), len(v))."""
        along = _trapezoid(s - self.place - 0.5 * self.length, self.length, self.edge)
        return np.asarray(-self.depth * np.outer(along, _across(self.side, self._section, v)))

    def _section(self, v: Floats) -> Floats:
        return _trapezoid(v - self.offset, self.width, self.edge)


def _positive(what: str, **sizes: float) -> None:
    for name, value in sizes.items():
        if not value > 0.0:
            raise RoadError(f"the {what}'s {name} is {value:g} m; it must be positive")


def _check_wave(what: str, length: float) -> None:
    if length < SHORTEST_WAVE - 1e-9:
        raise RoadError(
            f"the {what}'s length of {length:g} m is too short for the road's grid, which resolves "
            f"{SHORTEST_WAVE:g} m or more"
        )


def _check_place(what: str, place: float) -> None:
    if place < FIRST_PLACE:
        raise RoadError(
            f"the {what} begins at {place:g} m, where the car starts; {FIRST_PLACE:g} m is the "
            "first place for it"
        )


def _cosine(place: Floats, length: float, height: float) -> Floats:
    return np.asarray(0.5 * height * (1.0 - np.cos(2.0 * np.pi * place / length)))


def _trapezoid(place: Floats, size: float, edge: float) -> Floats:
    """Return 1 around 0, falling to 0 over `edge` up to half the `size` away."""
    return np.asarray(np.clip((0.5 * size - np.abs(place)) / edge, 0.0, 1.0))


def _half(v: Floats) -> Floats:
    """Return 1 on the left half of the road, falling to 0 towards the middle."""
    return np.asarray(np.clip(v / _INNER, 0.0, 1.0))


def _across(side: Side, section: Callable[[Floats], Floats], v: Floats) -> Floats:
    """Return a cross section that is given for the left, on its side of the road."""
    if side == "both" and section is _half:
        return np.ones_like(v)
    left = section(v) if side != "right" else np.zeros_like(v)
    return left + section(-v) if side != "left" else left
