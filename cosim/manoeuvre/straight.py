"""Braking and accelerating straight ahead."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosim.driver_model import DriverModel
from cosim.manoeuvre.line import deviation
from cosim.manoeuvre.motion import Array, Motion
from cosim.manoeuvre.plan import KMH, SPARE_ROAD, Figures, Plan, constant
from cosim.manoeuvre.programme import REST_S, Pedals
from cosim.road.track import Track

SURE_GRIP: Final = 7.0  # m/s2 on dry asphalt; who asks for more may not get it
REST: Final = 0.05  # m/s


@dataclass(frozen=True)
class SpeedChange:
    """From `speed` to `end` [m/s] by an acceleration [m/s2] or a pedal, negative for braking.

    The driver keeps to the road's line all the while.
    """

    speed: float
    end: float
    start: float
    step_s: float
    acceleration: float | None = None
    pedal: float | None = None
    friction: float = 1.0

    @property
    def _expected(self) -> tuple[float, float]:
        """Time [s] and way [m] that the change takes, by the driver's model."""
        m = DriverModel()
        if self.acceleration is not None:
            wanted = abs(self.acceleration)
        elif (pedal := float(self.pedal or 0.0)) < 0.0:
            wanted = -pedal * m.brake_force / m.mass
        else:
            wanted = pedal * min(m.drive_force, m.drive_power / self.end) / m.mass
        rate = max(min(wanted, self.friction * SURE_GRIP), 0.05)
        time = abs(self.end - self.speed) / rate
        return time, 0.5 * (self.speed + self.end) * time

    @property
    def road_length(self) -> float:
        """Half as much again as it should take."""
        return self.start + 1.5 * self._expected[1] + SPARE_ROAD

    def plan(self, track: Track) -> Plan:
        """Return the plan."""
        programme = Pedals(self.start, self.end, self.step_s, self.pedal, self.acceleration)
        time = self.start / self.speed + 1.5 * self._expected[0] + REST_S

        def figures(motion: Motion) -> Figures:
            return change_figures(motion, programme.begin, self.end, track)

        return Plan(track, constant(track, self.speed), time, figures, programme)


def change_figures(motion: Motion, begin: int, end: float, line: Track) -> Figures:
    """Return time and distance of a change of speed that begins with row `begin`, to `end` [m/s].

    The mean acceleration is that over the way between a fifth and nine tenths of the change, which
    for braking to a stand is the mean fully developed deceleration of UN Regulation 13-H, Annex 3:
    from 80 to 10 % of the speed. It is positive either way.
    """
    if begin < 0:
        return {}
    v = motion.vx[begin:]
    slows = v[0] > end
    reached = v <= max(end, REST) if slows else v >= end
    if not reached.any():
        return {}
    last = begin + int(np.argmax(reached))
    travelled = motion.travelled
    way = travelled - travelled[begin]
    between = [v[0] + share * (end - v[0]) for share in (0.2, 0.9)]
    places = [float(np.interp(_first(v, speed, bool(slows)), np.arange(len(v)), way[begin:]))
              for speed in between]  # fmt: skip
    rate = (between[0] ** 2 - between[1] ** 2) / (2.0 * (places[1] - places[0]))
    off = deviation(motion, line, float(travelled[begin]), float(travelled[-1]))
    return {
        "start_speed_kmh": float(v[0]) * KMH,
        "time_s": float(motion.time[last] - motion.time[begin]),
        "distance_m": float(way[last]),
        ("mean_deceleration_m_s2" if slows else "mean_acceleration_m_s2"): abs(rate),
        "path_deviation_m": float(np.abs(off).max()),
        "yaw_change_deg": math.degrees(float(np.abs(motion.yaw[begin:] - motion.yaw[begin]).max())),
    }


def _first(v: Array, speed: float, slows: bool) -> float:
    """Return the row, between two, at which a speed is first reached."""
    reached = np.flatnonzero(v <= speed if slows else v >= speed)
    i = int(reached[0])
    return float(i) if i == 0 else i - 1 + float((speed - v[i - 1]) / (v[i] - v[i - 1]))
