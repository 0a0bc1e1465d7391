"""Open-loop steering from steady straight driving: sine with dwell and step steer."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosim.manoeuvre.motion import Array, Motion
from cosim.manoeuvre.plan import KMH, SPARE_ROAD, Figures, Plan, constant
from cosim.manoeuvre.programme import Steering
from cosim.road.track import Track

COAST_S: Final = 0.5  # from releasing the accelerator to the beginning of steer [s]
AFTER_DWELL_S: Final = 2.0  # what is looked at after completion of steer [s]
STEP_HELD_S: Final = 4.0  # a step is held so long [s]
STEADY_S: Final = 1.0  # the last of it counts as steady [s]
DISPLACEMENT_S: Final = 1.07  # after the beginning of steer [s]


@dataclass(frozen=True)
class SineWithDwell:
    """One sine at the steering wheel that dwells at its second peak (ISO 19365; FMVSS 126).

    `amplitude` [rad] is that of the steering-wheel angle, positive when it begins to the left. The
    car coasts, as in both standards.
    """

    speed: float
    start: float
    amplitude: float
    frequency: float
    dwell: float
    step_s: float

    @property
    def steering_s(self) -> float:
        """Time from beginning to completion of steer [s]."""
        return 1.0 / self.frequency + self.dwell

    @property
    def road_length(self) -> float:
        """As long as the car would go straight on."""
        return self.start + self.speed * (self.steering_s + AFTER_DWELL_S) + SPARE_ROAD

    def angle(self, time: float) -> float:
        """Return the steering-wheel angle [rad] at a time after the beginning of steer [s]."""
        peak = 0.75 / self.frequency
        if time > peak:
            time = max(peak, time - self.dwell)
        return self.amplitude * math.sin(math.tau * self.frequency * min(time, 1 / self.frequency))

    def plan(self, track: Track) -> Plan:
        """Return the plan for a straight track."""
        duration = self.steering_s + AFTER_DWELL_S
        programme = Steering(self.angle, self.start, duration, COAST_S, self.step_s)

        def figures(motion: Motion) -> Figures:
            side = math.copysign(1.0, self.amplitude)
            return dwell_figures(motion, programme.begin, self.steering_s, side)

        time = self.start / self.speed + duration
        return Plan(track, constant(track, self.speed), time, figures, programme)


@dataclass(frozen=True)
class StepSteer:
    """A step of the steering-wheel angle, the accelerator held where it was (ISO 7401:2011).

    `amplitude` [rad] is positive to the left, `rise` [s] the duration of the ramp.
    """

    speed: float
    start: float
    amplitude: float
    rise: float
    step_s: float

    @property
    def road_length(self) -> float:
        """As long as the car would go straight on."""
        return self.start + self.speed * (self.rise + STEP_HELD_S) + SPARE_ROAD

    def angle(self, time: float) -> float:
        """Return the steering-wheel angle [rad] at a time after the beginning of the ramp [s]."""
        return self.amplitude * min(max(time / self.rise, 0.0), 1.0)

    def plan(self, track: Track) -> Plan:
        """Return the plan for a straight track."""
        duration = self.rise + STEP_HELD_S
        programme = Steering(self.angle, self.start, duration, None, self.step_s)

        def figures(motion: Motion) -> Figures:
            return step_figures(motion, programme.begin, math.copysign(1.0, self.amplitude))

        time = self.start / self.speed + duration
        return Plan(track, constant(track, self.speed), time, figures, programme)


def dwell_figures(motion: Motion, begin: int, steering_s: float, side: float) -> Figures:
    """Return the criteria of ISO 19365 and FMVSS 126 S5.2; steering begins with row `begin`, takes
    `steering_s` [s], and first goes to `side` (1 left, -1 right).

    The peak of the yaw rate is the largest one after the steering-wheel angle has changed its sign,
    against the side it began with; the shares of it that are left 1.00 s and 1.75 s after
    completion of steer count with its sign. The lateral displacement is that of the reference point
    from its straight course, 1.07 s after the beginning.
    """
    if begin < 0 or motion.time[-1] < motion.time[begin] + steering_s + 1.75:
        return {}
    time = motion.time - motion.time[begin]
    rate = -side * motion.yaw_rate
    reversed_ = (time > 0.0) & (side * motion.steering_wheel < 0.0)
    if not reversed_.any():
        return {}
    peak = float(rate[np.argmax(reversed_) :].max())
    shares = [100.0 * float(np.interp(steering_s + t, time, rate)) / peak for t in (1.0, 1.75)]
    return {
        "start_speed_kmh": float(motion.vx[begin]) * KMH,
        "yaw_rate_peak_deg_s": math.degrees(peak),
        "yaw_rate_after_1_00_s_percent": shares[0],
        "yaw_rate_after_1_75_s_percent": shares[1],
        "lateral_displacement_m": side * _displacement(motion, begin, time),
        "lateral_acceleration_max_m_s2": float(np.abs(motion.ay[begin:]).max()),
    }


def _displacement(motion: Motion, begin: int, time: Array) -> float:
    """Return how far left of its course of the last half second before the steering the car is
    after `DISPLACEMENT_S` [m].
    """
    x = float(np.interp(DISPLACEMENT_S, time, motion.x)) - motion.x[begin]
    y = float(np.interp(DISPLACEMENT_S, time, motion.y)) - motion.y[begin]
    first = int(np.searchsorted(time, -0.5))
    before = complex(motion.x[begin] - motion.x[first], motion.y[begin] - motion.y[first])
    course = cmath.phase(before) if abs(before) > 0.0 else float(motion.yaw[begin])
    return float(y * math.cos(course) - x * math.sin(course))


def step_figures(motion: Motion, begin: int, side: float) -> Figures:
    """Return the figures of ISO 7401:2011 clause 9.2; the ramp begins with row `begin`.

    Times count from where the steering-wheel angle reaches half of its steady value: response time
    to 90 % of the steady yaw rate or lateral acceleration, peak response time to the yaw rate's
    peak. Steady is the mean of the last second. The gain is yaw rate over steering-wheel angle.
    """
    if begin < 0 or motion.time[-1] < motion.time[begin] + 2 * STEADY_S:
        return {}
    before = motion.time < motion.time[begin]
    last = motion.time > motion.time[-1] - STEADY_S
    values = {}
    for name in ("steering_wheel", "yaw_rate", "ay"):
        signal = side * getattr(motion, name)
        values[name] = signal - (float(signal[before][-100:].mean()) if before.any() else 0.0)
    wheel, rate, ay = (float(values[n][last].mean()) for n in ("steering_wheel", "yaw_rate", "ay"))
    reference = _reached(motion.time, values["steering_wheel"], 0.5 * wheel, begin)
    peak = begin + int(np.argmax(values["yaw_rate"][begin:]))

    def after(name: str, level: float) -> float:
        return _reached(motion.time, values[name], level, begin) - reference

    return {
        "start_speed_kmh": float(motion.vx[begin]) * KMH,
        "steering_wheel_deg": math.degrees(wheel),
        "yaw_rate_deg_s": math.degrees(rate),
        "yaw_gain_per_s": rate / wheel,
        "yaw_response_time_s": after("yaw_rate", 0.9 * rate),
        "yaw_peak_time_s": float(motion.time[peak]) - reference,
        "yaw_overshoot_percent": 100.0 * (float(values["yaw_rate"][peak]) / rate - 1.0),
        "lateral_acceleration_m_s2": ay,
        "lateral_acceleration_response_time_s": after("ay", 0.9 * ay),
    }


def _reached(time: Array, signal: Array, level: float, begin: int) -> float:
    """Return when a signal first reaches a level after row `begin` [s], between the samples."""
    above = np.flatnonzero(signal[begin:] >= level)
    if not len(above):
        return math.nan
    i = begin + int(above[0])
    if i == begin:
        return float(time[i])
    share = (level - signal[i - 1]) / (signal[i] - signal[i - 1])
    return float(time[i - 1] + share * (time[i] - time[i - 1]))
