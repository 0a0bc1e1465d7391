"""What may happen to the channels of a car, done to recorded ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNEL_NAMES, SAMPLE_RATE_HZ
from sensor.conditions import PRODUCTION
from sensor.features import WHEEL_SPEEDS

Array = npt.NDArray[np.float64]

FIRST = 1500  # the first fault, 15 s after the start
LENGTH = 500  # of a fault, in samples
PERIOD = 2000  # from one fault to the next
COUNT = 3
SAMPLES = FIRST + COUNT * PERIOD
_GRAVITY = 9.81
_IMU = slice(0, 3), slice(3, 6)
_SPEEDS = [CHANNEL_NAMES.index("Car.vx"), *WHEEL_SPEEDS]


def frozen(channel: Array, _row: int, _random: np.random.Generator) -> Array:
    """The last value is held: what is done where a message is missing, too."""
    return np.full(len(channel), channel[0])


def biased(channel: Array, row: int, _random: np.random.Generator) -> Array:
    """Off by three standard deviations of its data sheet's offset (or scale error, or noise)."""
    sheet = PRODUCTION[row]
    scale = PRODUCTION[WHEEL_SPEEDS[0]].scale if row in _SPEEDS else 0.0
    return channel + 3.0 * (scale * channel if scale else sheet.bias)


def noisy(channel: Array, row: int, random: np.random.Generator) -> Array:
    """Ten times the production noise."""
    return channel + random.normal(scale=10.0 * PRODUCTION[row].noise, size=len(channel))


def lost(channel: Array, _row: int, _random: np.random.Generator) -> Array:
    """Zero: a message whose content was not filled in."""
    return np.zeros(len(channel))


FAULTS: Mapping[str, Callable[[Array, int, np.random.Generator], Array]] = {
    "frozen": frozen,
    "biased": biased,
    "noisy": noisy,
    "zero": lost,
}


def faulty(measured: Array, row: int, fault: str) -> Array:
    """Return channels (samples, 14) with one of them faulty for `LENGTH` samples, `COUNT` times."""
    result = np.array(measured, dtype=np.float64)
    random = np.random.default_rng([row, list(FAULTS).index(fault)])
    for k in range(COUNT):
        begin = FIRST + k * PERIOD
        part = slice(begin, begin + LENGTH)
        # the sample before the fault is the first that is shown to it: what is held
        result[part, row] = FAULTS[fault](measured[begin - 1 : part.stop, row], row, random)[1:]
    return result


def drifting(measured: Array, per_ten_minutes: tuple[float, float], radius: float) -> Array:
    """Return channels whose IMU offsets grow, [m/s2] and [rad/s] per ten minutes, and whose wheel
    speeds grow, by `radius` (ratio) in all: two of them upward, two downward.
    """
    result = np.array(measured, dtype=np.float64)
    minutes = np.arange(len(result))[:, np.newaxis] / (600.0 * SAMPLE_RATE_HZ)
    for part, rate in zip(_IMU, per_ten_minutes, strict=True):
        result[:, part] += minutes * rate
    share = np.linspace(0.0, radius, len(result))[:, np.newaxis]
    result[:, WHEEL_SPEEDS] *= 1.0 + share * np.array([1.0, -1.0, -1.0, 1.0])
    return result


def mounted(stage: Array, further: tuple[float, float, float], turned: float) -> Array:
    """Return the sensor stage (samples, 11) of an IMU that sits `further` [m] away and is turned by
    `turned` [rad] about each axis in turn.

    Rigid body: a + alpha x r + omega x (omega x r); alpha from differences of the rates.
    """
    result = np.array(stage, dtype=np.float64)
    force, rate = result[:, 0:3].copy(), result[:, 3:6].copy()
    force[:, 2] += _GRAVITY
    arm = np.broadcast_to(np.array(further), rate.shape)
    force += np.cross(np.gradient(rate, 1.0 / SAMPLE_RATE_HZ, axis=0), arm)
    force += np.cross(rate, np.cross(rate, arm))
    about = _rotation(turned)
    result[:, 0:3], result[:, 3:6] = force @ about, rate @ about
    result[:, 2] -= _GRAVITY
    return result


def _rotation(angle: float) -> Array:
    """Rotation by the same angle about x, y and z, one after the other."""
    c, s = np.cos(angle), np.sin(angle)
    x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return z @ y @ x
