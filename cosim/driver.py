"""The driver block: follows the track's centre line by preview and a speed profile by pedals.

Lateral: steady-state steer for the previewed curvature plus a correction of the deviation predicted
a second ahead (single-point preview as in MacAdam, IEEE Trans. SMC 11, 1981). Longitudinal: the
profile's own acceleration, the slope and the drag as feed-forward, and a proportional-integral
correction of the speed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.road import Track
from cosim.vehicle import State

Array = npt.NDArray[np.float64]

VX: Final = 6  # channel 7, Car.vx
SPACING: Final = 0.5  # of the points at which the driver knows the road [m]


@dataclass(frozen=True)
class DriverModel:
    """What the driver knows of his car, and how he drives. SI units.

    `understeer` is 2 deg/g at the hand wheel over the ratio, the package's vehicle at 2 to 4 m/s2;
    `rear_slip` is the rear axle's slip angle per lateral acceleration, weight over cornering
    stiffness. Another car only costs the feed-forward some accuracy.
    """

    wheelbase: float = 2.675
    cog_to_rear: float = 1.236
    steering_ratio: float = 16.5
    understeer: float = 0.0036  # rad per m/s2, at the road wheels
    rear_slip: float = 0.0063  # rad per m/s2
    mass: float = 2520.0  # with the rotating parts' inertia
    drive_force: float = 19700.0  # at full accelerator [N]
    drive_power: float = 267e3  # [W]
    brake_force: float = 28500.0  # at full pedal [N]
    drag: float = 0.546  # N per (m/s)^2
    rolling: float = 240.0  # N
    preview_time: float = 0.15  # curvature preview: rack and tyre lags [s]
    correction_time: float = 0.9  # look-ahead of the correction [s]
    correction_distance: float = 6.0  # its minimum [m]
    pedal_lag: float = 0.15  # [s]
    speed_gain: float = 1.0  # 1/s
    speed_integral: float = 0.15  # 1/s^2
    creep_speed: float = 0.7  # up to a stop line [m/s]


class PathDriver:
    """Drives a car along a track at a given speed profile (n,) [m/s] over `track.s`.

    `step(k, state)` returns the same buffer every time: steering-wheel angle [rad, left positive],
    accelerator and brake pedal (0..1). `finished` turns true at the end of the lap.
    """

    def __init__(
        self, track: Track, speed: Array, step_s: float, model: DriverModel | None = None
    ) -> None:
        self.model = model or DriverModel()
        self.finished = False
        self.deviation = 0.0  # lateral distance from the centre line, left positive [m]
        self.largest_deviation = 0.0
        self.command = np.zeros(3)
        self._h = step_s
        self._length = track.length
        every = max(round(SPACING / float(track.s[1] - track.s[0])), 1)
        self._first = float(track.s[0])
        self._spacing = every * float(track.s[1] - track.s[0])

        def points(values: Array) -> list[float]:
            """A list hands over one float at a time fastest, and that is what the loop needs."""
            picked: list[float] = values[::every].tolist()
            return picked

        self._x, self._y = points(track.x), points(track.y)
        self._cosine, self._sine = points(np.cos(track.heading)), points(np.sin(track.heading))
        self._heading, self._curvature = points(track.heading), points(track.curvature)
        self._grade, self._speed = points(track.grade), points(speed)
        self._acceleration = points(np.gradient(speed * speed, track.s) / 2)
        self._stops = [(s, round(wait / step_s)) for s, wait in track.stops]
        self._release = -1  # step at which a standing car may leave, -1 while driving
        self._index = round(-self._first / self._spacing)
        self._earliest = 0  # of the profile: behind a stop that is over, its braking counts no more
        self._along = 0.0  # from the point at `_index` [m]
        self._integral = 0.0
        self._demand = 0.0

    def step(self, k: int, state: State) -> Array:
        """Return the commands for [t_k, t_k+1]."""
        x, y, yaw = state.pose.tolist()
        v = float(state.channels[VX])
        s = self._locate(x, y)
        self.finished = s >= self._length
        self.command[0] = self._steer(v, yaw)
        self.command[1], self.command[2] = self._pedals(k, s, v)
        return self.command

    def _locate(self, x: float, y: float) -> float:
        """Walk to the nearest point of the centre line; return its s and keep the deviation."""
        i, last = self._index, len(self._x) - 1
        half = 0.5 * self._spacing
        for _ in range(last):
            dx, dy = x - self._x[i], y - self._y[i]
            along = dx * self._cosine[i] + dy * self._sine[i]
            if along > half and i < last:
                i += 1
            elif along < -half and i > 0:
                i -= 1
            else:
                break
        self._index, self._along = i, along
        self.deviation = dy * self._cosine[i] - dx * self._sine[i]
        if abs(self.deviation) > self.largest_deviation:
            self.largest_deviation = abs(self.deviation)
        return self._first + i * self._spacing + along

    def _at(self, values: list[float], distance: float) -> float:
        i = max(self._index, self._earliest) + int((self._along + distance) / self._spacing + 0.5)
        return values[i if i < len(values) else -1]

    def _steer(self, v: float, yaw: float) -> float:
        m = self.model
        bend = self._at(self._curvature, max(v, 0.0) * m.preview_time)
        steady = (m.wheelbase + m.understeer * v * v) * bend
        # A car in a bend points off its course by its side slip: that is no heading error.
        here = self._curvature[self._index]
        side_slip = (m.cog_to_rear - m.rear_slip * v * v) * here
        course = self._heading[self._index] + here * self._along
        error = math.remainder(yaw + side_slip - course, math.tau)
        ahead = max(m.correction_distance, m.correction_time * v)
        predicted = self.deviation + ahead * math.sin(error)
        correction = -2 * (m.wheelbase + m.understeer * v * v) / (ahead * ahead) * predicted
        return m.steering_ratio * min(max(steady + correction, -0.55), 0.55)

    def _pedals(self, k: int, s: float, v: float) -> tuple[float, float]:
        if self._stops and self._standing(k, s, v):
            return 0.0, 0.35
        m, h = self.model, self._h
        lead = max(v, 0.0) * m.pedal_lag
        target, feed = self._at(self._speed, lead), self._at(self._acceleration, lead)
        if target < m.creep_speed:  # near a stop line: roll up to it, and away from it
            target, feed = m.creep_speed, 0.0
        error = target - v
        wanted = feed + m.speed_gain * error + self._integral
        if abs(error) < 2.0:
            self._integral = min(max(self._integral + m.speed_integral * error * h, -0.5), 0.5)
        self._demand += (wanted - self._demand) * h / m.pedal_lag
        slope = 9.81 * self._grade[self._index]
        force = m.mass * (self._demand + slope) + m.drag * v * v + m.rolling
        if force >= 0:
            return min(force / min(m.drive_force, m.drive_power / max(v, 1.0)), 1.0), 0.0
        return 0.0, min(-force / m.brake_force, 1.0)

    def _standing(self, k: int, s: float, v: float) -> bool:
        """Stop sections: hold the brake at the line until the wait is over."""
        line, wait = self._stops[0]
        if self._release < 0:
            if s < line - 0.4 and not (v < 0.3 and s > line - 2.0):
                return False
            if v < 0.05:
                self._release = k + wait
            return True
        if k < self._release:
            return True
        self._stops.pop(0)
        self._earliest = int((line + 0.5 - self._first) / self._spacing)
        self._release, self._integral, self._demand = -1, 0.0, 0.0
        return False
