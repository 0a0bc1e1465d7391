"""The line that is driven where it is not the road's own: beside it, by an offset that varies."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PPoly
from scipy.spatial import KDTree

from cosim.manoeuvre.motion import Motion
from cosim.road.track import DS, RUN_OUT, Track

Array = npt.NDArray[np.float64]

_FINE: Final = 0.01  # spacing at which an offset's length is integrated [m]


def beside(track: Track, offset: PPoly, end: float) -> Track:
    """Return the line at `offset` (s) [m] to the left of a straight `track`, up to its s = `end`.

    The offset has a continuous second derivative; before its first and behind its last breakpoint
    it stays as it is there, where it must be level. The line's own s starts with the road's.
    """
    first, last = float(offset.x[0]), float(offset.x[-1])
    along = np.arange(track.s[0], min(end + RUN_OUT, float(track.s[-1])), _FINE)
    inside = np.clip(along, first, last)
    within = (along >= first) & (along <= last)
    slope = np.where(within, offset.derivative()(inside), 0.0)
    stretch = np.hypot(1.0, slope)
    run = np.concatenate(([0.0], np.cumsum(0.5 * _FINE * (stretch[1:] + stretch[:-1]))))
    run += along[0]
    s: Array = along[0] + DS * np.arange(int((run[-1] - run[0]) / DS) + 1)
    u = np.interp(s, run, along)
    t, slope, bend = (_kept(offset, order, u) for order in (0, 1, 2))
    return Track(
        name=track.name,
        length=float(np.interp(end, along, run)),
        closed=False,
        s=s,
        x=u.copy(),
        y=t,
        z=np.interp(u, track.s, track.z),
        heading=np.arctan(slope),
        curvature=bend / (1.0 + slope * slope) ** 1.5,
        grade=np.interp(u, track.s, track.grade),
        banking=np.interp(u, track.s, track.banking),
        speed_limit=np.interp(u, track.s, track.speed_limit),
    )


def beside_bends(track: Track, offset: Callable[[Array], Array]) -> tuple[Track, Array]:
    """Return the line at `offset`(s) [m] to the left of any open `track`, and the s of the track
    beside each of its points (n,) [m].

    The offset has a continuous second derivative and is 0 up to s = 0, where the line's own s
    starts with the road's.
    """
    t = offset(track.s)
    slope = np.gradient(t, track.s)
    ahead = 1.0 - track.curvature * t
    x = track.x - t * np.sin(track.heading)
    y = track.y + t * np.cos(track.heading)
    heading = track.heading + np.arctan2(slope, ahead)
    stretch = np.hypot(ahead, slope)
    run = np.concatenate(([0.0], np.cumsum(0.5 * DS * (stretch[1:] + stretch[:-1])))) + track.s[0]
    curvature = np.gradient(heading, run)
    s: Array = track.s[0] + DS * np.arange(int((run[-1] - run[0]) / DS) + 1)

    def at(values: Array) -> Array:
        return np.asarray(np.interp(s, run, values), dtype=np.float64)

    line = Track(
        track.name, float(np.interp(track.length, track.s, run)), False, s, at(x), at(y),
        at(track.z), at(heading), at(curvature), at(track.grade), at(track.banking),
        at(track.speed_limit),
    )  # fmt: skip
    return line, at(track.s)


def _kept(offset: PPoly, order: int, u: Array) -> Array:
    """Return a derivative of the offset; outside its breakpoints it is level."""
    first, last = float(offset.x[0]), float(offset.x[-1])
    values = np.asarray(offset.derivative(order)(np.clip(u, first, last)), dtype=np.float64)
    return values if order == 0 else np.where((u >= first) & (u <= last), values, 0.0)


def deviation(motion: Motion, line: Track, start: float, end: float) -> Array:
    """Return the distances from the line between its s = `start` and `end` [m], left positive."""
    rows = between(motion, start, end)
    part = (line.s >= start - 10.0) & (line.s <= end + 10.0)
    if not rows.any() or not part.any():
        return np.zeros(0)
    x, y, heading = line.x[part], line.y[part], line.heading[part]
    _, i = KDTree(np.column_stack((x, y))).query(np.column_stack((motion.x[rows], motion.y[rows])))
    dx, dy = motion.x[rows] - x[i], motion.y[rows] - y[i]
    return np.asarray(dy * np.cos(heading[i]) - dx * np.sin(heading[i]), dtype=np.float64)


def between(motion: Motion, start: float, end: float) -> npt.NDArray[np.bool_]:
    """Return the rows (rows,) in which the car has travelled from `start` to `end` [m]."""
    travelled = motion.travelled
    return np.asarray((travelled >= start) & (travelled <= end))
