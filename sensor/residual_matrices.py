"""The wheel-speed residuals of `sensor.features` as products with constant matrices, which torch
and an ONNX graph can both hold.

With x one sample (14,) in SI units, all (4,):

    residual = clip(x wheels - (x driving) / cos(x steering) * (x slip + rolling), +-limit)

In double precision: 30 m/s of driving are taken from a speed that is 30 m/s and a few mm/s.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sensor.body_motion import Geometry
from sensor.channels import CHANNEL_NAMES
from sensor.features import WHEEL_SPEEDS, Slip

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ResidualMatrices:
    """`wheels`, `driving`, `steering`, `slip` (14, 4), `rolling` (4,), `limit` [m/s], `spread`
    (4, 14), which puts the residuals in the wheel speeds' places, and `others` (14,), which is 0
    there and 1 elsewhere.
    """

    wheels: Array
    driving: Array
    steering: Array
    slip: Array
    rolling: Array
    limit: float
    spread: Array
    others: Array

    @classmethod
    def of(cls, geometry: Geometry | None = None, slip: Slip | None = None) -> "ResidualMatrices":
        """Return the matrices of a car."""
        g, s = geometry or Geometry(), slip or Slip()
        y = np.array([g.left_y, g.right_y, g.left_y, g.right_y])
        wheels = np.eye(len(CHANNEL_NAMES))[:, WHEEL_SPEEDS]
        return cls(
            wheels=wheels,
            driving=_columns({"Car.vx": np.ones(4), "Car.YawRate": -y}),
            steering=_columns({"Car.SteerAngleFL": np.eye(4)[0], "Car.SteerAngleFR": np.eye(4)[1]}),
            slip=_columns({"Car.ax": np.full(4, s.per_ax), "Car.ay": -s.per_ay * np.sign(y)}),
            rolling=1.0 + np.array([s.front, s.front, s.rear, s.rear]),
            limit=s.limit,
            spread=wheels.T.copy(),
            others=1.0 - wheels.sum(axis=1),
        )

    def driven(self, channels: Array) -> Array:
        """Return the wheel speeds (samples, 4) [m/s] that driving alone gives."""
        rolled = channels @ self.driving / np.cos(channels @ self.steering)
        return np.asarray(rolled * (channels @ self.slip + self.rolling))


def _columns(rows: dict[str, Array]) -> Array:
    """Return a (14, 4) matrix from the rows of the channels that are not zero."""
    matrix = np.zeros((len(CHANNEL_NAMES), 4))
    for name, row in rows.items():
        matrix[CHANNEL_NAMES.index(name)] = row
    return matrix
