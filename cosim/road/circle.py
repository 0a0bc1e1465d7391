"""The circle of ISO 4138: a straight entry, a clothoid and an arc of constant radius."""

from __future__ import annotations

from functools import lru_cache

from cosim.errors import did_you_mean
from cosim.road.elements import Arc, Straight
from cosim.road.errors import RoadError
from cosim.road.track import Layout, Track, build_track

ENTRY, EXIT = 60.0, 40.0  # straights before and behind the arc [m]
DIRECTIONS = ("left", "right")


@lru_cache(maxsize=8)
def load_circle(radius: float, angle_deg: float = 270.0, direction: str = "left") -> Track:
    """Return the track of an arc of `radius` [m] that turns by `angle_deg` [deg].

    The clothoids at its ends are half as long as the radius, so that the car turns by 14 deg while
    the steering-wheel angle is built up. Raises `RoadError` for a value that makes no such road.
    """
    if direction not in DIRECTIONS:
        raise RoadError(
            f"direction '{direction}' is not left or right{did_you_mean(direction, DIRECTIONS)}"
        )
    if not (radius >= 10.0 and 30.0 <= angle_deg <= 360.0):
        raise RoadError(
            f"a circle of {radius:g} m radius that turns by {angle_deg:g} deg cannot be built: "
            "give a radius of at least 10 m and an angle of 30 to 360 deg"
        )
    arc = Arc(float(radius), float(angle_deg), direction == "left")
    return build_track(Layout("circle", (Straight(ENTRY), arc, Straight(EXIT)), 0.5 * radius))


def arc_section(track: Track) -> tuple[float, float]:
    """Return where the curvature of a circle's track is constant: from s to s [m]."""
    full = abs(track.curvature) > (1.0 - 1e-9) * abs(track.curvature).max()
    return float(track.s[full][0]), float(track.s[full][-1])
