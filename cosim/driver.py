"""The driver block: follows a line by preview and a speed profile by pedals.

Lateral: steady-state steer for the previewed curvature plus a correction of the deviation predicted
half a second ahead (single-point preview as in MacAdam, IEEE Trans. SMC 11, 1981); in bends that
take the car near its limit the driver learns how much more it wants. Longitudinal: the profile's
own acceleration, the slope and the resistance as feed-forward, and a proportional-integral
correction of the speed.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.driver_model import DriverModel
from cosim.road import Track
from cosim.testbench import State

Array = npt.NDArray[np.float64]

VX: Final = 6  # channel 7, Car.vx
SPACING: Final = 0.5  # of the points at which the driver knows the road [m]
LARGEST_LESSON: Final = 3.0  # of the deviation that is learned away [m]
STANDING_PEDAL: Final = 0.35  # holds the car on any road


class PathDriver:
    """Drives a car along a line at a given speed profile (n,) [m/s] over `track.s`.

    `step(k, state)` returns the same buffer every time: steering-wheel angle [rad, left positive],
    accelerator and brake pedal (0..1). `finished` turns true at the end of the lap.
    """

    def __init__(
        self, track: Track, speed: Array, step_s: float, model: DriverModel | None = None
    ) -> None:
        self.model = model or DriverModel()
        self.finished = False
        self.s = 0.0  # place along the line [m]
        self.deviation = 0.0  # lateral distance from the line, left positive [m]
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
        self._brake = 0.0  # pedal at a stop
        self._lesson = 0.0

    def step(self, k: int, state: State) -> Array:
        """Return the commands for [t_k, t_k+1]."""
        x, y, yaw = state.pose.tolist()
        v = float(state.channels[VX])
        self.s = self._locate(x, y)
        self.finished = self.s >= self._length
        self.command[0] = self._steer(v, yaw)
        self.command[1], self.command[2] = self._pedals(k, self.s, v)
        return self.command

    @property
    def completed(self) -> bool:
        """Whether the end of the lap was reached."""
        return self.finished

    def _locate(self, x: float, y: float) -> float:
        """Walk to the nearest point of the line; return its s and keep the deviation."""
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
        # A car in a bend points off its course by its side slip: that is no heading error.
        here = self._curvature[self._index]
        course = self._heading[self._index] + here * self._along
        error = math.remainder(yaw + m.steady_side_slip(v, here) - course, math.tau)
        ahead = max(m.correction_distance, m.correction_time * v)
        predicted = self.deviation + ahead * math.sin(error) + self._learned(v, here, bend)
        correction = -2 * (m.wheelbase + m.understeer * v * v) / (ahead * ahead) * predicted
        steer = m.steady_steer(v, bend) + correction
        return m.steering_ratio * min(max(steer, -m.largest_steer), m.largest_steer)

    def _learned(self, v: float, here: float, bend: float) -> float:
        """Return what long bends near the limit have taught, as a deviation [m].

        It goes with the lateral acceleration, so that it is gone where the bend ends.
        """
        m, lateral = self.model, v * v * here
        if abs(lateral) > m.learning_from:
            inward = self.deviation * math.copysign(1.0, lateral)
            self._lesson += inward * self._h / m.learning_time
            self._lesson = min(max(self._lesson, -LARGEST_LESSON), LARGEST_LESSON)
        return self._lesson * v * v * bend / m.saturation

    def _pedals(self, k: int, s: float, v: float) -> tuple[float, float]:
        if self._stops and self._stopping(k, s, v):
            return 0.0, self._brake
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
        force = m.mass * (self._demand + slope)
        return m.pedals(force + m.resistance(v, self._curvature[self._index]), v)

    def _stopping(self, k: int, s: float, v: float) -> bool:
        """Stop sections: brake softly to a stand at the line, hold until the wait is over."""
        line, wait = self._stops[0]
        if self._release < 0:
            if s < line - 0.4 and not (v < 0.3 and s > line - 2.0):
                return False
            self._brake = self._softly(line - s, v)
            if v < 0.05:
                self._release = k + wait
            return True
        if k < self._release:
            self._brake = min(self._brake + STANDING_PEDAL * self._h, STANDING_PEDAL)
            return True
        self._stops.pop(0)
        self._earliest = int((line + 0.5 - self._first) / self._spacing)
        self._release, self._integral, self._demand, self._brake = -1, 0.0, 0.0, 0.0
        return False

    def _softly(self, distance: float, v: float) -> float:
        """Return the brake pedal that ends the creeping `distance` [m] ahead, whatever the slope;
        at the end it also holds the car.
        """
        m, slope = self.model, 9.81 * self._grade[self._index]
        if v > 0.15:
            deceleration = min(max(v * v / (2 * max(distance, 0.1)), 0.5), 1.5)
            return max(m.mass * (deceleration - slope) - m.rolling, 0.0) / m.brake_force
        return max(self._brake, m.mass * (abs(slope) + 0.3) / m.brake_force)
