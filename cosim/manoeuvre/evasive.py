"""Manoeuvres between cones: the double lane change and the slalom."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from cosim.driver_model import DriverModel
from cosim.manoeuvre import lane_change, slalom
from cosim.manoeuvre.gates import Body, Edge, clearance
from cosim.manoeuvre.line import beside, deviation
from cosim.manoeuvre.motion import Motion
from cosim.manoeuvre.plan import KMH, SPARE_ROAD, Figures, Plan, constant, speed_figures
from cosim.manoeuvre.programme import Coasting
from cosim.road.track import Track
from cosim.scenario.combinations import too_fast


@dataclass(frozen=True)
class DoubleLaneChange:
    """Through the gates of ISO 3888-2 from `start` [m] on with `speed` [m/s] at the entry, where
    the accelerator is released.
    """

    speed: float
    start: float
    body: Body
    friction: float | None = None

    @property
    def road_length(self) -> float:
        """Run-up, the five sections and the run-out."""
        return self.start + self._length + SPARE_ROAD

    @property
    def _length(self) -> float:
        return sum(lane_change.LENGTHS) + lane_change.RUN_OUT

    def plan(self, track: Track) -> Plan:
        """Return the plan for a straight track; the course lies about its middle."""
        sections = lane_change.gates(self.body.width)
        y = -0.5 * sections[1].middle
        side_slip = DriverModel().steady_side_slip(self.speed, 1e-6) / 1e-6
        path = lane_change.gentlest_path(sections, self.body, side_slip)
        lateral = float(np.abs(path.derivative(2)(path.x)).max()) * self.speed**2
        sentence = too_fast(
            "the double lane change", round(self.speed * KMH, 3), lateral, self.friction
        )
        if sentence is not None:
            raise ValueError(sentence)
        line = beside(track, lane_change.moved(path, self.start, y), self.start + self._length)
        figures = partial(
            lane_change_figures,
            line=line,
            body=self.body,
            edges=lane_change.edges(sections, self.start, y),
        )
        programme = Coasting(self.start, line.length)
        return Plan(
            line, constant(line, self.speed), 1.2 * line.length / self.speed, figures, programme
        )


@dataclass(frozen=True)
class Slalom:
    """Round `cones` at `speed` [m/s], the body's side `clearance` [m] away from them."""

    speed: float
    cones: slalom.Cones
    clearance: float
    body: Body

    @property
    def road_length(self) -> float:
        """Run-up, the cones and the straight behind them."""
        return self._end + SPARE_ROAD

    @property
    def _end(self) -> float:
        return self.cones.places[-1] + 2 * self.cones.spacing

    def plan(self, track: Track) -> Plan:
        """Return the plan for a straight track; the cones stand on its line."""
        path = slalom.path(self.cones, self.body, self.clearance)
        line = beside(track, path, self._end)
        figures = partial(
            slalom_figures, line=line, body=self.body, cones=self.cones, speed=self.speed
        )
        return Plan(line, constant(line, self.speed), line.length / self.speed, figures)


def lane_change_figures(
    motion: Motion, line: Track, body: Body, edges: tuple[Edge, ...]
) -> Figures:
    """Return how the gates were passed: clearance, speeds at entry and exit, largest deviation from
    the line, lateral acceleration and yaw rate.
    """
    start, end = edges[0].start, edges[-1].end
    rows = (motion.x >= start) & (motion.x <= end)
    found = clearance(motion, body, edges)
    if found is None or not rows.any():
        return {}
    return {
        "clearance_m": found,
        "entry_speed_kmh": float(np.interp(start, motion.x, motion.vx)) * KMH,
        "exit_speed_kmh": float(np.interp(end, motion.x, motion.vx)) * KMH,
        **_largest(motion, line, start, end),
    }


def slalom_figures(
    motion: Motion, line: Track, body: Body, cones: slalom.Cones, speed: float
) -> Figures:
    """Return how the cones were passed, from the first to the last."""
    start, end = cones.places[0], cones.places[-1]
    rows = (motion.x >= start) & (motion.x <= end)
    found = clearance(motion, body, cones.edges)
    if found is None or not rows.any():
        return {}
    return {
        "clearance_m": found,
        **speed_figures(motion.vx[rows], speed),
        **_largest(motion, line, start, end),
    }


def _largest(motion: Motion, line: Track, start: float, end: float) -> Figures:
    rows = (motion.x >= start) & (motion.x <= end)
    off = deviation(motion, line, float(np.interp(start, line.x, line.s)), line.length)
    return {
        "path_deviation_m": float(np.abs(off).max()),
        "lateral_acceleration_max_m_s2": float(np.abs(motion.ay[rows]).max()),
        "yaw_rate_max_deg_s": float(np.degrees(np.abs(motion.yaw_rate[rows]).max())),
    }
