"""No manoeuvre: the road by the style of the driver."""

from __future__ import annotations

from dataclasses import dataclass

from cosim.manoeuvre.plan import Plan
from cosim.road.track import Track
from cosim.speed_profile import Style, speed_profile, travel_time


@dataclass(frozen=True)
class FollowRoad:
    """The road's own line within the limits of `style`, not faster than `cap` [m/s]."""

    style: Style
    cap: float | None

    @property
    def road_length(self) -> float | None:
        """The road's own."""
        return None

    def plan(self, track: Track) -> Plan:
        """Return the plan; it has no figures."""
        speed = speed_profile(track, self.style, self.cap)
        time = travel_time(track, speed)
        return Plan(track, speed, time, lambda motion: {}, end="end of the road")
