"""A track: the line that a road follows, its grade and banking, its limits and stops."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicHermiteSpline, PPoly

from cosim.road.elements import Element, curvature_profile, follow, gauss_points

Floats = npt.NDArray[np.float64]
Knots = tuple[tuple[float, float], ...]

DS = 0.05  # spacing of every track [m]; a road's cross sections stand at the same places
LEAD_IN = 20.0  # road before s = 0 [m], so that the whole car stands on it at the start
RUN_OUT = 60.0  # road behind the end [m], so that the car can finish at speed
_NEAR = 15.0  # how far nearest() looks from a hint [m]


class Stop(NamedTuple):
    """A place to stop at: `s` [m], for `dwell` [s]."""

    s: float
    dwell: float


class Pose(NamedTuple):
    """The reference line at one place, in the units of `Track`."""

    x: float
    y: float
    z: float
    heading: float
    curvature: float
    grade: float
    banking: float


@dataclass(frozen=True, eq=False)
class Track:
    """The reference line on a uniform grid of s, from the lead-in (s < 0) to the run-out.

    All arrays have shape (n,). x, y, z in m (ISO 8855: z up), `heading` in rad counter-clockwise
    and continuous, `curvature` in 1/m positive to the left, `grade` = dz/ds, `banking` the cross
    slope, positive when the left side is higher (as in OpenCRG). `speed_limit` in m/s. The lead-in
    and the run-out of a closed circuit lie on its own end and start.
    """

    name: str
    length: float
    closed: bool
    s: Floats
    x: Floats
    y: Floats
    z: Floats
    heading: Floats
    curvature: Floats
    grade: Floats
    banking: Floats
    speed_limit: Floats
    stops: tuple[Stop, ...] = ()

    def __post_init__(self) -> None:
        for values in (self.s, *self.lines(), self.speed_limit):
            values.flags.writeable = False

    def lines(self) -> tuple[Floats, ...]:
        """Return x, y, z, heading, curvature, grade and banking, in the order of `Pose`."""
        return self.x, self.y, self.z, self.heading, self.curvature, self.grade, self.banking

    def pose(self, s: float) -> Pose:
        """Return the line at `s` [m], linear between the grid's points, kept beyond its ends."""
        place = min(max((s - self.s[0]) / DS, 0.0), len(self.s) - 1.0)
        i = min(int(place), len(self.s) - 2)
        share = place - i
        return Pose(*(float(q[i] + share * (q[i + 1] - q[i])) for q in self.lines()))

    def speed_limit_at(self, s: float) -> float:
        """Return the speed limit at `s` [m/s]."""
        i = min(max(round((s - self.s[0]) / DS), 0), len(self.s) - 1)
        return float(self.speed_limit[i])

    def nearest(self, x: float, y: float, near: float | None = None) -> tuple[float, float]:
        """Return s [m] of the point nearest to (x, y) and the offset to the left of it [m].

        With `near`, the s of the last answer, only its surroundings are searched, which keeps the
        lap where a circuit overlaps its own start; without it the first of equally near places
        counts.
        """
        first, last = 0, len(self.s)
        if near is not None:
            first = min(max(int((near - _NEAR - self.s[0]) / DS), 0), last - 2)
            last = min(max(int((near + _NEAR - self.s[0]) / DS), first + 2), last)
        distance = np.hypot(self.x[first:last] - x, self.y[first:last] - y)
        i = first + int(np.argmax(distance <= distance.min() + 0.01))  # the first of equals
        i = _descend(self, i, last, x, y)
        c, d = math.cos(self.heading[i]), math.sin(self.heading[i])
        dx, dy = x - self.x[i], y - self.y[i]
        offset = dy * c - dx * d
        along = (dx * c + dy * d) / max(1.0 - float(self.curvature[i]) * offset, 0.1)
        return float(self.s[i] + min(max(along, -DS), DS)), float(offset)


def _descend(track: Track, i: int, last: int, x: float, y: float) -> int:
    """Walk from point i up the line for as long as that comes nearer to (x, y)."""
    distance = math.hypot(track.x[i] - x, track.y[i] - y)
    while i + 1 < last:
        further = math.hypot(track.x[i + 1] - x, track.y[i + 1] - y)
        if further > distance:
            break
        i, distance = i + 1, further
    return i


@dataclass(frozen=True)
class Layout:
    """What a track is built from.

    `grade` and `banking` are (s [m], value [-]) pairs, joined by smooth steps without a kink;
    before the first and behind the last the value stays. `limits` are (from s [m], km/h) pairs.
    `transition` is the clothoids' length [m], `heading` the direction at s = 0 [rad].
    """

    name: str
    elements: tuple[Element, ...]
    transition: float
    closed: bool = False
    heading: float = 0.0
    grade: Knots = ((0.0, 0.0),)
    banking: Knots = ((0.0, 0.0),)
    limits: Knots = ((0.0, math.inf),)
    stops: tuple[Stop, ...] = ()


def build_track(layout: Layout) -> Track:
    """Return the track of a layout, its line integrated to round-off from the curvature."""
    length = sum(e.length for e in layout.elements)
    count = math.ceil((LEAD_IN + length + RUN_OUT) / DS) + 1
    s: Floats = np.asarray(-LEAD_IN + DS * np.arange(count), dtype=np.float64)
    curvature, heading = _bends(layout, length)
    start = round(LEAD_IN / DS)
    x, y = follow(heading(gauss_points(s)), DS)
    grade = smooth_steps(layout.grade)
    place = _wrapped(s, length) if layout.closed else s
    z = _integral(grade, s, layout, length)
    limits = np.array(layout.limits)
    limit = limits[np.searchsorted(limits[:, 0], np.maximum(place, limits[0, 0]), "right") - 1, 1]
    return Track(
        name=layout.name,
        length=length,
        closed=layout.closed,
        s=s,
        x=x - x[start],
        y=y - y[start],
        z=z,
        heading=heading(s),
        curvature=curvature(s),
        grade=grade(place),
        banking=smooth_steps(layout.banking)(place),
        speed_limit=limit / 3.6,
        stops=layout.stops,
    )


def smooth_steps(knots: Knots) -> Callable[[Floats], Floats]:
    """Return the function through (s, value) `knots`, level at each of them and outside."""
    places, values = np.array(knots).T
    if len(places) == 1:
        return lambda s: np.full_like(s, values[0])
    spline = CubicHermiteSpline(places, values, np.zeros_like(values))
    return lambda s: np.asarray(spline(np.clip(s, places[0], places[-1])), dtype=np.float64)


def _wrapped(s: Floats, length: float) -> Floats:
    return np.asarray(np.mod(s, length), dtype=np.float64)


def _bends(
    layout: Layout, length: float
) -> tuple[Callable[[Floats], Floats], Callable[[Floats], Floats]]:
    """Return curvature(s) and heading(s): lap after lap, or straight on outside an open road."""
    curvature: PPoly = curvature_profile(layout.elements, layout.transition)
    turned: PPoly = curvature.antiderivative()
    lap = float(turned(length))

    def bend(s: Floats) -> Floats:
        inside = _wrapped(s, length) if layout.closed else np.clip(s, 0.0, length)
        within = layout.closed | ((s >= 0.0) & (s <= length))
        return np.where(within, curvature(inside), 0.0)

    def heading(s: Floats) -> Floats:
        if layout.closed:
            laps = np.floor(s / length)
            return np.asarray(layout.heading + laps * lap + turned(s - laps * length))
        return np.asarray(layout.heading + turned(np.clip(s, 0.0, length)))

    return bend, heading


def _integral(
    grade: Callable[[Floats], Floats], s: Floats, layout: Layout, length: float
) -> Floats:
    """Return z of the line [m], 0 at s = 0: Simpson's rule, which is exact for a cubic grade."""

    def wrapped(q: Floats) -> Floats:
        return grade(_wrapped(q, length) if layout.closed else q)

    rise = (wrapped(s[:-1]) + 4.0 * wrapped(0.5 * (s[1:] + s[:-1])) + wrapped(s[1:])) * (DS / 6.0)
    z = np.concatenate(([0.0], np.cumsum(rise)))
    return np.asarray(z - z[round(LEAD_IN / DS)])
