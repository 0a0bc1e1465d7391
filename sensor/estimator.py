"""What every estimator of the suspension velocities offers: the network, and the baselines beside
it.
"""

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from numpy import float64

from sensor.channels import OUTPUTS


class Estimator(Protocol):
    """An estimator that takes one sample at a time.

    `estimate` (4,) [m/s], positive in extension, order FL FR RL RR, and `deviation` (4,) [m/s], its
    predicted standard deviation, are the same arrays at every step; NaN until valid. An estimator
    that predicts no deviation leaves it NaN; one that does also has the method
    `apply_with_deviation`, which returns the pair.
    """

    estimate: npt.NDArray[float64]
    deviation: npt.NDArray[float64]

    def reset(self) -> None:
        """Forget all samples."""

    def step(self, measured: npt.NDArray[float64], command: npt.NDArray[float64]) -> bool:
        """Take one sample (14,) in SI units and the damper command (4,), 0 soft to 1 hard, that was
        held over the interval which ends at it; update `estimate`; return whether it is valid.
        """

    def apply(
        self, channels: npt.NDArray[float64], commands: npt.NDArray[float64]
    ) -> npt.NDArray[float64]:
        """Estimate a whole run from a fresh start, untouched by `step`: channels (samples, 14) and
        commands (samples, 4), each held until its sample -> (samples, 4) [m/s], NaN until valid.
        """


def sample_by_sample(
    estimator: Estimator,
    channels: npt.NDArray[np.floating[Any]],
    commands: npt.NDArray[np.floating[Any]],
) -> tuple[npt.NDArray[float64], npt.NDArray[float64]]:
    """Return estimates and deviations (samples, 4) [m/s] of a whole run, NaN where they do not
    count; the estimator is fresh before and after.
    """
    result = np.full((2, len(channels), len(OUTPUTS)), np.nan)
    samples, held = (np.asarray(part, dtype=np.float64) for part in (channels, commands))
    estimator.reset()
    for k in range(len(samples)):
        if estimator.step(samples[k], held[k]):
            result[0, k], result[1, k] = estimator.estimate, estimator.deviation
    estimator.reset()
    return result[0], result[1]
