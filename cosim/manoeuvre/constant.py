"""Constant speed along a road, and on the circle of ISO 4138."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from cosim.manoeuvre.line import between, deviation
from cosim.manoeuvre.motion import Motion
from cosim.manoeuvre.plan import RUN_UP_S, Figures, Plan, constant, speed_figures
from cosim.road.circle import arc_section
from cosim.road.track import Track


@dataclass(frozen=True)
class ConstantSpeed:
    """The road's own line at `speed` [m/s], measured from the end of the run-up."""

    speed: float

    @property
    def road_length(self) -> float | None:
        """The road's own."""
        return None

    def plan(self, track: Track) -> Plan:
        """Return the plan."""
        start = min(RUN_UP_S * self.speed, 0.5 * track.length)
        figures = partial(held_figures, line=track, start=start, end=track.length, speed=self.speed)
        return Plan(track, constant(track, self.speed), track.length / self.speed, figures)


@dataclass(frozen=True)
class ConstantRadius:
    """The circle at `speed` [m/s]: constant radius, one constant speed (ISO 4138:2021, clause 8).

    It is measured in the second half of the arc, where the state is steady.
    """

    speed: float

    @property
    def road_length(self) -> float | None:
        """The road's own."""
        return None

    def plan(self, track: Track) -> Plan:
        """Return the plan for the track of a circle."""
        start, end = arc_section(track)
        middle = 0.5 * (start + end)
        figures = partial(circle_figures, line=track, start=middle, end=end, speed=self.speed)
        return Plan(track, constant(track, self.speed), track.length / self.speed, figures)


def held_figures(motion: Motion, line: Track, start: float, end: float, speed: float) -> Figures:
    """Return speed and deviation from the line between its s = `start` and `end` [m]."""
    rows = between(motion, start, end)
    if not rows.any():
        return {}
    off = np.abs(deviation(motion, line, start, end))
    return {**speed_figures(motion.vx[rows], speed), "path_deviation_m": float(off.max())}


def circle_figures(motion: Motion, line: Track, start: float, end: float, speed: float) -> Figures:
    """Return the steady state between s = `start` and `end` [m] of a circle, as means.

    Signs are those of a left-hand bend: lateral acceleration and steering-wheel angle are positive,
    the side slip angle is negative where the nose points into the bend.
    """
    rows = between(motion, start, end)
    if not rows.any():
        return {}
    side = float(np.sign(np.interp(start, line.s, line.curvature)))
    return {
        **held_figures(motion, line, start, end, speed),
        "lateral_acceleration_m_s2": side * float(motion.ay[rows].mean()),
        "side_slip_deg": side * float(np.degrees(motion.side_slip[rows].mean())),
        "steering_wheel_deg": side * float(np.degrees(motion.steering_wheel[rows].mean())),
        "yaw_rate_deg_s": side * float(np.degrees(motion.yaw_rate[rows].mean())),
    }
