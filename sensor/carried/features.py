"""What the network with carried state reads: signals with the driving, the slow errors and the
wheelbase delay taken care of.

By sample, from the channels and the damper commands:
- accelerations and rates, those that have no lasting part (a_z, roll rate, pitch rate) without
  their slow mean: IMU bias, grade and bank go with it;
- speed, steering, damper commands;
- wheel-speed residuals (`sensor.features`) without their slow relative mean: wear, pressure and
  the wheel's own radius go with it;
- heave velocity, roll and pitch angle of the body, by leaky integration;
- first and second differences of accelerations, rates and residuals from sample to sample: forces
  follow from accelerations, and those of roll and pitch are differences of the rates;
- what the front axle felt one wheelbase ago: the rear wheels run over the same road L/v later.
  Front residuals, a_z, roll and pitch rate, each at `leads` samples after the rear wheel's own
  moment: what came after the front's passage tells more of it than the passage itself.

A car on its suspension is nearly linear: twice the road gives twice the motion. So whatever moves
with the road is divided by the present level of motion (a slow rms of a_z, roll and pitch rate;
wheels may slip), and the network's output is multiplied by it: a smooth lane change and a row of
bumps look alike to the network, and the level itself tells it where the dampers bend.

Every filter is a recursion of first order, so that the same features can be computed inside a
streaming graph (`sensor.carried.graph`); here they are computed for whole runs.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNEL_NAMES, SAMPLE_RATE_HZ
from sensor.features import residuals

Array = npt.NDArray[np.float64]

AX, AY, AZ, ROLL, PITCH, YAW, VX = range(7)
STEER = (7, 8, 13)
MEANS = 7  # slow means: relative residual of four wheels, a_z, roll rate, pitch rate
INTEGRALS = 3  # heave velocity, roll angle, pitch angle
LINE = 10  # signals in the delay line: four residuals, a_z, roll and pitch rate, a_x, a_y, yaw rate
DELAYED = (0, 1, 4, 5, 6)  # of these: front residuals, a_z, roll rate, pitch rate


@dataclass(frozen=True)
class FeatureConfig:
    """Constants of the features; times in s, `wheelbase` in m, `leads` and `depth` in samples.

    The delay line holds `depth` samples: below wheelbase / (depth / 100 Hz) = 2.1 m/s the delayed
    signals are its oldest. `slip_limit` bounds what a spinning wheel may do to the slow mean of
    its residual. A slow mean moves by 1 / (k + `settling`) at first (residuals, IMU), by 1 / its
    time later. The level is 1 where a_z, roll and pitch rate have their `typical` rms.
    """

    wheelbase: float = 2.675
    depth: int = 128
    leads: tuple[int, ...] = (-4, -2, 0, 1, 2, 3, 4, 5, 6, 8, 10, 12)
    slip_time: float = 10.0
    slip_limit: float = 0.02
    bias_time: float = 30.0
    settling: tuple[float, float] = (0.5, 2.0)
    heave_time: float = 4.0
    angle_time: float = 5.0
    least_speed: float = 2.0
    level_time: float = 1.5
    least_level: float = 0.02
    typical: tuple[float, float, float] = (0.5, 0.03, 0.03)
    largest: float = 20.0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the features, in their order."""
        wheels = ("FL", "FR", "RL", "RR")
        line = (
            *(f"Residual.{w}" for w in wheels),
            *("az", "RollVel", "PitchVel", "ax", "ay", "YawRate"),
        )
        return (
            "ax", "ay", "YawRate", "vx", "1/vx", "log level",
            *(CHANNEL_NAMES[i] for i in STEER),
            *(f"Damper.{w}" for w in wheels),
            *(f"Residual.{w}" for w in wheels),
            "az", "RollVel", "PitchVel",
            "HeaveVel", "Roll", "Pitch",
            *(f"d {name}" for name in line),
            *(f"d2 {name}" for name in line),
            *(f"{line[i]}@{lead:+d}" for lead in self.leads for i in DELAYED),
        )  # fmt: skip

    @property
    def count(self) -> int:
        """Number of features."""
        return len(self.names)


def features(
    channels: npt.NDArray[np.floating[Any]],
    commands: npt.NDArray[np.floating[Any]],
    config: FeatureConfig | None = None,
) -> npt.NDArray[np.float32]:
    """Return the features of a run from its first sample on and, as the last column, the level by
    which the network's output is multiplied: (samples, `config.count` + 1), from channels (samples,
    14) and damper commands (samples, 4), SI units.
    """
    c = config or FeatureConfig()
    x = np.asarray(channels, dtype=np.float64)
    speed = np.maximum(x[:, [VX]], c.least_speed)
    wheel, free = unbiased(x, speed, c)
    h = 1.0 / SAMPLE_RATE_HZ
    heave = leaky_integral(free[:, :1], c.heave_time, h)
    angles = leaky_integral(free[:, 1:], c.angle_time, h)
    line = np.hstack([wheel, free, x[:, [AX, AY, YAW]]])
    first = np.diff(line, axis=0, prepend=np.zeros((1, LINE)))
    second = np.diff(first, axis=0, prepend=np.zeros((1, LINE)))
    delay = c.wheelbase * SAMPLE_RATE_HZ / speed[:, 0]
    delayed = [
        taken(line[:, DELAYED], np.clip(delay - lead, 0.0, c.depth - 3.0)) for lead in c.leads
    ]
    level = levels(free, c)
    moving = np.hstack([wheel, free, heave, angles, first, second, *delayed]) / level
    moving /= scales(c)
    parts = [
        x[:, [AX, AY, YAW]], x[:, [VX]] / 30.0, 10.0 / speed, np.log(level), x[:, list(STEER)],
        np.asarray(commands), np.clip(moving, -c.largest, c.largest), level,
    ]  # fmt: skip
    return np.hstack(parts).astype(np.float32)


def scales(c: FeatureConfig) -> Array:
    """Return the typical size of each moving feature at level 1, (moving,)."""
    line = np.array([0.02, 0.02, 0.02, 0.02, *c.typical, 0.5, 0.5, 0.03])
    return np.concatenate(
        [
            line[:7],
            [0.05, 0.01, 0.01],
            line,
            line,
            np.tile(line[list(DELAYED)], len(c.leads)),
        ]
    )


def levels(signals: Array, c: FeatureConfig) -> Array:
    """Return the level of motion (samples, 1): slow rms of a_z, roll and pitch rate (samples, 3)
    over their typical rms, at least `least_level`.
    """
    square = np.square(signals / np.array(c.typical)).mean(axis=1, keepdims=True)
    return np.sqrt(slow_mean(square, c.level_time, 0.25 * c.level_time) + c.least_level**2)


def unbiased(x: Array, speed: Array, c: FeatureConfig) -> tuple[Array, Array]:
    """Return residuals (samples, 4) [m/s] and (a_z, roll rate, pitch rate) without slow means."""
    wheel = residuals(x)
    relative = np.clip(wheel / speed, -c.slip_limit, c.slip_limit)
    slip = slow_mean(relative, c.slip_time, c.settling[0])
    imu = x[:, AZ:YAW]
    return wheel - slip * speed, imu - slow_mean(imu, c.bias_time, c.settling[1])


def slow_mean(x: Array, time: float, settling: float) -> Array:
    """Mean that begins at zero, follows quickly at first and with the time constant `time` later.

    m_k = m_(k-1) + a_k (x_k - m_(k-1)), a_k = max(1 / (k + 1 + n0), 1 / n) with n samples in `time`
    and n0 in `settling` [s]: at first the mean of all samples and of n0 zeros before them.
    """
    from scipy.signal import lfilter

    n, n0 = time * SAMPLE_RATE_HZ, settling * SAMPLE_RATE_HZ
    first = min(len(x), max(int(n - n0), 0))
    mean = np.empty_like(x)
    mean[:first] = np.cumsum(x[:first], axis=0) / (np.arange(1, first + 1) + n0)[:, np.newaxis]
    if first < len(x):
        a = 1.0 / n
        before = mean[first - 1 : first] if first else np.zeros((1, x.shape[1]))
        mean[first:] = lfilter([a], [1.0, a - 1.0], x[first:], axis=0, zi=(1.0 - a) * before)[0]
    return mean


def leaky_integral(x: Array, time: float, h: float) -> Array:
    """Integral that forgets with the time constant `time` [s].

    y_k = (1 - h/time) y_(k-1) + h x_k.
    """
    from scipy.signal import lfilter

    return np.asarray(lfilter([h], [1.0, h / time - 1.0], x, axis=0))


def taken(source: Array, age: Array) -> Array:
    """Return each row of `source` (samples, n) as it was `age` (samples,) samples ago; before the
    start there was nothing.

    Cubic (Lagrange) between four samples, two on each side: linear interpolation halfway between
    samples would take 41 % off a motion of 30 Hz, this takes 22 %. Of the newest sample, which has
    no newer one beside it, the nearest serves.
    """
    whole = np.floor(age).astype(np.int64)
    part = (age - whole)[:, np.newaxis]
    now = np.arange(len(source))
    padded = np.vstack([np.zeros((1, source.shape[1])), source])
    result = np.zeros((len(source), source.shape[1]))
    for step, weight in zip((-1, 0, 1, 2), lagrange(part), strict=True):
        back = np.maximum(whole + step, 0)
        result += weight * padded[np.maximum(now - back + 1, 0)]
    return result


def lagrange(part: Array) -> tuple[Array, Array, Array, Array]:
    """Weights of the samples at -1, 0, 1 and 2 for a place `part` (0 to 1) after 0."""
    p = part
    return (
        p * (1.0 - p) * (p - 2.0) / 6.0,
        (p + 1.0) * (p - 1.0) * (p - 2.0) / 2.0,
        (p + 1.0) * p * (2.0 - p) / 2.0,
        (p + 1.0) * p * (p - 1.0) / 6.0,
    )
