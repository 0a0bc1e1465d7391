"""What every estimator of the suspension velocities offers: the network, and the baselines beside
it.
"""

from typing import Protocol

import numpy.typing as npt
from numpy import float64


class Estimator(Protocol):
    """An estimator that takes one sample at a time.

    `estimate` (4,) [m/s], positive in extension, order FL FR RL RR, is the same array at every
    step; NaN until valid.
    """

    estimate: npt.NDArray[float64]

    def reset(self) -> None:
        """Forget all samples."""

    def step(self, measured: npt.NDArray[float64]) -> bool:
        """Take one sample (14,) in SI units, update `estimate`; return whether it is valid."""

    def apply(self, channels: npt.NDArray[float64]) -> npt.NDArray[float64]:
        """Estimate a whole run from a fresh start: (samples, 14) -> (samples, 4) [m/s], NaN until
        valid.
        """
