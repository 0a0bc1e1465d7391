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
    its residual.
    """

    wheelbase: float = 2.675
    depth: int = 128
    leads: tuple[int, ...] = (-4, 0, 4, 8, 12)
    slip_time: float = 5.0
    slip_limit: float = 0.02
    bias_time: float = 8.0
    heave_time: float = 2.0
    angle_time: float = 3.0
    least_speed: float = 2.0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the features, in their order."""
        wheels = ("FL", "FR", "RL", "RR")
        line = (
            *(f"Residual.{w}" for w in wheels),
            *("az", "RollVel", "PitchVel", "ax", "ay", "YawRate"),
        )
        return (
            "ax", "ay", "az", "RollVel", "PitchVel", "YawRate", "vx", "1/vx",
            *(CHANNEL_NAMES[i] for i in STEER),
            *(f"Damper.{w}" for w in wheels),
            *(f"Residual.{w}" for w in wheels),
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
    """Return the features (samples, `config.count`) of a run from its first sample on: channels
    (samples, 14) and damper commands (samples, 4), SI units.
    """
    c = config or FeatureConfig()
    x = np.asarray(channels, dtype=np.float64)
    speed = np.maximum(x[:, [VX]], c.least_speed)
    wheel, free = unbiased(x, speed, c)
    body = x[:, : YAW + 1].copy()
    body[:, AZ:YAW] = free
    h = 1.0 / SAMPLE_RATE_HZ
    heave = leaky_integral(free[:, :1], c.heave_time, h)
    angles = leaky_integral(free[:, 1:], c.angle_time, h)
    source = np.hstack([wheel, free, x[:, [AX, AY, YAW]]])
    first = np.diff(source, axis=0, prepend=np.zeros((1, LINE)))
    second = np.diff(first, axis=0, prepend=np.zeros((1, LINE)))
    delay = c.wheelbase * SAMPLE_RATE_HZ / speed[:, 0]
    delayed = [
        taken(source[:, DELAYED], np.clip(delay - lead, 0.0, c.depth - 2.0)) for lead in c.leads
    ]
    parts = [
        body, x[:, [VX]] / 30.0, 10.0 / speed, x[:, list(STEER)], np.asarray(commands), wheel,
        heave, angles, first, second, *delayed,
    ]  # fmt: skip
    return np.hstack(parts).astype(np.float32)


def unbiased(x: Array, speed: Array, c: FeatureConfig) -> tuple[Array, Array]:
    """Return residuals (samples, 4) [m/s] and (a_z, roll rate, pitch rate) without slow means."""
    wheel = residuals(x)
    relative = np.clip(wheel / speed, -c.slip_limit, c.slip_limit)
    slip = slow_mean(relative, c.slip_time * SAMPLE_RATE_HZ)
    imu = x[:, AZ:YAW]
    return wheel - slip * speed, imu - slow_mean(imu, c.bias_time * SAMPLE_RATE_HZ)


def slow_mean(x: Array, samples: float) -> Array:
    """Mean of all samples so far for the first `samples`, then an exponential one of that length.

    m_k = m_(k-1) + a_k (x_k - m_(k-1)) with a_k = max(1 / (k + 1), 1 / samples).
    """
    from scipy.signal import lfilter

    first = min(len(x), int(samples))
    mean = np.empty_like(x)
    mean[:first] = np.cumsum(x[:first], axis=0) / np.arange(1, first + 1)[:, np.newaxis]
    if first < len(x):
        a = 1.0 / samples
        start = (1.0 - a) * mean[first - 1 : first]
        mean[first:] = lfilter([a], [1.0, a - 1.0], x[first:], axis=0, zi=start)[0]
    return mean


def leaky_integral(x: Array, time: float, h: float) -> Array:
    """Integral that forgets with the time constant `time` [s].

    y_k = (1 - h/time) y_(k-1) + h x_k.
    """
    from scipy.signal import lfilter

    return np.asarray(lfilter([h], [1.0, h / time - 1.0], x, axis=0))


def taken(source: Array, age: Array) -> Array:
    """Return each row of `source` (samples, n) as it was `age` (samples,) samples ago, linear in
    between; before the start there was nothing.
    """
    whole = np.floor(age).astype(np.int64)
    part = (age - whole)[:, np.newaxis]
    newer = np.arange(len(source)) - whole
    padded = np.vstack([np.zeros((1, source.shape[1])), source])
    near, far = (padded[np.maximum(i + 1, 0)] for i in (newer, newer - 1))
    return np.asarray(near * (1.0 - part) + far * part)
