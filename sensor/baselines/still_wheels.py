"""Body motion only: with wheels that keep their height, a corner of the body moving upward extends
its suspension as fast.
"""

import numpy as np
import numpy.typing as npt

from sensor.body_motion import BodyMotion, Geometry
from sensor.channels import OUTPUTS
from sensor.window import check_sample

Array = npt.NDArray[np.float64]


class StillWheels:
    """Estimates the body's corner velocity (upward = extension), valid from the first sample."""

    def __init__(self, geometry: Geometry | None = None) -> None:
        self._body = BodyMotion(geometry)
        self.estimate = np.full(len(OUTPUTS), np.nan)
        self.deviation = np.full(len(OUTPUTS), np.nan)

    def reset(self) -> None:
        """Forget all samples."""
        self._body.reset()
        self.estimate.fill(np.nan)

    def step(self, measured: Array, command: Array) -> bool:
        """Take one sample (14,) in SI units; raises SensorError naming a channel that is NaN or
        infinite.
        """
        check_sample(measured)
        self.estimate[:] = self._body.step(measured)
        return True

    def apply(self, channels: Array, commands: Array) -> Array:
        """Estimate a whole run: (samples, 14) -> (samples, 4) [m/s]."""
        return self._body.apply(channels)
