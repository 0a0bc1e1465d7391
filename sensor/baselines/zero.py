"""The suspension does not move: accuracy 0 % by definition, what anything must beat."""

import numpy as np
import numpy.typing as npt

from sensor.channels import OUTPUTS

Array = npt.NDArray[np.float64]


class Zero:
    """Estimates 0 m/s at every wheel, valid from the first sample."""

    def __init__(self) -> None:
        self.estimate = np.full(len(OUTPUTS), np.nan)
        self.deviation = np.full(len(OUTPUTS), np.nan)

    def reset(self) -> None:
        """Forget all samples."""
        self.estimate.fill(np.nan)

    def step(self, measured: Array, command: Array) -> bool:
        """Take one sample (14,) and the damper command (4,)."""
        self.estimate.fill(0.0)
        return True

    def apply(self, channels: Array, commands: Array) -> Array:
        """Return zeros (samples, 4) for a run (samples, 14)."""
        return np.zeros((len(channels), len(OUTPUTS)))
