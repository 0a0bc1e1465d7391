"""How fast a driver goes where: the g-g limit of a style over a track.

Quasi-steady lap simulation by a forward and a backward pass (Brayshaw & Harrison, Proc. IMechE D
219, 2005): the curvature caps the speed, and what the lateral acceleration leaves of the g-g
ellipse accelerates and brakes.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.road import Track

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Style:
    """Acceleration limits of a driver [m/s2]: speeding up, braking (positive), cornering."""

    accelerate: float
    brake: float
    corner: float


@dataclass(frozen=True)
class Limits:
    """The same along a track, all (n,) [m/s2]."""

    accelerate: Array
    brake: Array
    corner: Array


STYLES: Final = {
    "aggressive": Style(4.0, 6.0, 5.0),
    "normal": Style(3.0, 4.0, 4.0),
    "defensive": Style(2.0, 2.0, 3.0),
}
GRIP_USED: Final = 0.65  # of the road's grip at most, so that friction 1 leaves the styles alone
ALONG: Final = 9.8  # what the tyres hold on dry asphalt [m/s2]
ACROSS: Final = 8.2


def careful(style: Style, friction: float) -> Style:
    """Return the style on a road whose `friction` (1 on dry asphalt) the driver knows."""
    along, across = GRIP_USED * ALONG * friction, GRIP_USED * ACROSS * friction
    return Style(min(style.accelerate, along), min(style.brake, along), min(style.corner, across))


def speed_profile(track: Track, style: Style, cap: float | None = None) -> Array:
    """Return the speed [m/s] at each point of `track.s` (n,); zero at the stops.

    `cap` [m/s] lowers the track's own speed limits. The run-out after the lap is driven on, not
    braked for.
    """
    curvature = np.abs(track.curvature)
    speed = np.sqrt(style.corner / np.maximum(curvature, 1e-6))
    speed = np.minimum(speed, track.speed_limit)
    if cap is not None:
        speed = np.minimum(speed, cap)
    for stop in track.stops:
        speed[np.searchsorted(track.s, stop[0])] = 0.0
    everywhere = [np.full_like(speed, value) for value in astuple(style)]
    return _within(track, speed, Limits(*everywhere))


def profile_within(track: Track, wanted: Array, limits: Limits) -> Array:
    """Return the speed [m/s] at each point of `track.s` (n,) that comes nearest to the `wanted` one
    (n,) within limits that change along the track.
    """
    bends = np.sqrt(limits.corner / np.maximum(np.abs(track.curvature), 1e-6))
    return _within(track, np.minimum(wanted, bends), limits)


def _within(track: Track, speed: Array, limits: Limits) -> Array:
    """Lower a speed (n,) to what accelerating from before and braking for what follows allow."""
    curvature = np.abs(track.curvature)
    step = float(track.s[1] - track.s[0])
    across = limits.corner
    forward = _limited(speed, curvature, step, limits.accelerate, across)
    back = (forward[::-1], curvature[::-1], step, limits.brake[::-1], across[::-1])
    return _limited(*back)[::-1]


def _limited(speed: Array, curvature: Array, step: float, along: Array, across: Array) -> Array:
    """One pass along the array: v dv/ds within the ellipse of `along` and `across` (n,)."""
    squares = (speed * speed).tolist()
    points = zip(curvature[:-1].tolist(), along.tolist(), across.tolist(), strict=False)
    for i, (bend, most, corner) in enumerate(points):
        used = min(squares[i] * bend / corner, 1.0)
        reachable = squares[i] + 2 * step * most * (1 - used * used) ** 0.5
        if reachable < squares[i + 1]:
            squares[i + 1] = reachable
    speeds: Array = np.sqrt(np.array(squares))
    return speeds


def travel_time(track: Track, speed: Array) -> float:
    """Return the time [s] of the profile from s = 0 to the end of the lap, stops included."""
    lap = (track.s >= 0) & (track.s <= track.length)
    slowness = 1 / np.maximum(speed[lap], 0.7)
    waits = sum(stop[1] for stop in track.stops)
    return float(np.trapezoid(slowness, track.s[lap])) + waits
