"""The wheel-speed residuals of `sensor.features` as products with constant matrices, which torch
and an ONNX graph can both hold.

With x one sample (14,) in SI units, all (4,):

    residual = clip(x wheels - (x driving) / cos(x steering) * (x slip + rolling), +-limit)

In double precision: 30 m/s of driving are taken from a speed that is 30 m/s and a few mm/s.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.body_motion import Geometry
from sensor.channels import CHANNEL_NAMES
from sensor.features import WHEEL_SPEEDS, Slip
from sensor.operation import DOUBLE, FLOAT, Operation, operation

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


def residual_operations() -> list[Operation]:
    """Return the operations of an ONNX graph from `measured` to `seen`, (batch, W, 14) both, the
    wheel speeds replaced by their residuals.
    """
    return [
        operation("Cast", "measured", "sample", to=DOUBLE),
        operation("MatMul", "sample wheels", "wheel_speed"),
        operation("MatMul", "sample driving", "driving_speed"),
        operation("MatMul", "sample steering", "steer_angle"),
        operation("MatMul", "sample slip", "driving_slip"),
        operation("Cos", "steer_angle", "steer_cosine"),
        operation("Div", "driving_speed steer_cosine", "rolling_speed"),
        operation("Add", "driving_slip rolling", "wheel_per_rolling"),
        operation("Mul", "rolling_speed wheel_per_rolling", "driven_speed"),
        operation("Sub", "wheel_speed driven_speed", "unbounded_residual"),
        operation("Clip", "unbounded_residual lowest highest", "residual"),
        operation("MatMul", "residual spread", "residual_in_place"),
        operation("Mul", "sample others", "other_channels"),
        operation("Add", "other_channels residual_in_place", "features_seen"),
        operation("Cast", "features_seen", "seen", to=FLOAT),
    ]


def residual_constants() -> dict[str, npt.NDArray[Any]]:
    """Return the constants of these operations, by name."""
    matrices = vars(ResidualMatrices.of()).copy()
    limit = np.array(matrices.pop("limit"))
    return matrices | {"lowest": -limit, "highest": limit}
