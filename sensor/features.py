"""Wheel-speed residuals: what the wheel speeds say of the suspension once the driving is taken out.

A wheel that climbs a bump moves back on its suspension, turns with its knuckle and changes its
radius, so it turns a few mm/s faster or slower. Beside 30 m/s of driving speed a network never sees
that: standardised, it vanishes. The residual of a wheel is its speed minus the speed that driving
alone would give it, computed sample by sample from the channels:

    v_i = (v_x - YawRate y_i) / cos(delta_i)        rigid body, wheel rolling in its own plane
    r_i = w_i - v_i (1 + a_x k_x - sign(y_i) a_y k_y + k_i)

with the slip that speeding up and braking need (k_x: mass over the tyres' slip stiffness), the load
transfer in turns, which changes the rolling radii (k_y), and each axle's own radius and toe (k_i).
A spinning or locking wheel tells nothing of its suspension: the residual is clipped.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.body_motion import Geometry
from sensor.channels import CHANNEL_NAMES, OUTPUT_NAMES

Array = npt.NDArray[np.float64]

RESIDUAL_NAMES = tuple(f"Residual.{name.split('.')[1]}" for name in OUTPUT_NAMES)
RESIDUAL_UNIT = "m/s"

_AX, _AY, _YAW, _VX = (CHANNEL_NAMES.index(f"Car.{name}") for name in ("ax", "ay", "YawRate", "vx"))
_STEER = [CHANNEL_NAMES.index(f"Car.SteerAngle{wheel}") for wheel in ("FL", "FR")]
WHEEL_SPEEDS = [CHANNEL_NAMES.index(f"Car.v{wheel}") for wheel in ("FL", "FR", "RL", "RR")]


@dataclass(frozen=True)
class Slip:
    """What driving does to the wheel speeds; fitted to laps on a smooth road.

    `per_ax` and `per_ay` [s2/m]: relative speed per longitudinal and (left minus, right plus)
    lateral acceleration; `front`, `rear`: relative speed of free rolling. The residual is clipped
    at +-`limit` [m/s], ten times what class B at 50 km/h needs.
    """

    per_ax: float = 0.0058
    per_ay: float = 0.0006
    front: float = -0.0018
    rear: float = 0.0002
    limit: float = 0.25


class WheelSpeedResiduals:
    """`residual` (4,) [m/s] of the newest sample, positive where the wheel turns faster than
    driving explains, order FL FR RL RR.
    """

    def __init__(self, geometry: Geometry | None = None, slip: Slip | None = None) -> None:
        g, s = geometry or Geometry(), slip or Slip()
        self._y = np.array([g.left_y, g.right_y, g.left_y, g.right_y])
        self._per_ay = -s.per_ay * np.sign(self._y)
        self._axle = 1.0 + np.array([s.front, s.front, s.rear, s.rear])
        self._per_ax, self._limit = s.per_ax, s.limit
        self.residual = np.zeros(4)

    def step(self, measured: Array) -> Array:
        """Take one sample (14,) in SI units and return `residual`, the same array every time."""
        self.residual[:] = self.apply(measured[np.newaxis])[0]
        return self.residual

    def apply(self, channels: npt.NDArray[np.floating[Any]]) -> Array:
        """Return the residuals (samples, 4) [m/s] of channels (samples, 14)."""
        x = np.asarray(channels, dtype=np.float64)
        driving = x[:, [_VX]] - x[:, [_YAW]] * self._y
        driving[:, :2] /= np.cos(x[:, _STEER])
        driving *= self._axle + self._per_ax * x[:, [_AX]] + self._per_ay * x[:, [_AY]]
        left: Array = x[:, WHEEL_SPEEDS] - driving
        np.clip(left, -self._limit, self._limit, out=left)
        return left


def residuals(channels: npt.NDArray[np.floating[Any]]) -> Array:
    """Return the residuals (samples, 4) [m/s] of channels (samples, 14) of the default car."""
    return WheelSpeedResiduals().apply(channels)


def with_residuals(channels: npt.NDArray[np.floating[Any]]) -> Array:
    """Return the channels (samples, 14) with the four wheel speeds replaced by their residuals."""
    result = np.array(channels, dtype=np.float64)
    result[:, WHEEL_SPEEDS] = residuals(channels)
    return result
