"""How well an estimate matches the truth, in two numbers that add up over samples and parts."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

LEAST_TRUTH_RMS = 0.010
"""Truth rms [m/s] below which accuracy is flagged as meaningless."""


@dataclass(frozen=True)
class Match:
    """RMSE of an estimate and rms of the truth, both in m/s.

    Squares of parts add up: over the four modes, or over the frequency bands, those of `rmse` sum
    to the square of the RMSE over all wheels, and those of `truth_rms` likewise.
    """

    rmse: float
    truth_rms: float

    @property
    def nrmse(self) -> float | None:
        """Equation 1: RMSE over the rms of the truth (ratio); None if the truth is exactly zero."""
        return self.rmse / self.truth_rms if self.truth_rms > 0.0 else None

    @property
    def accuracy(self) -> float | None:
        """Equation 2: 100 (1 - NRMSE) in percent; None if the truth is exactly zero."""
        return None if self.nrmse is None else 100.0 * (1.0 - self.nrmse)

    @property
    def accuracy_meaningful(self) -> bool:
        """Whether the truth moves enough, 10 mm/s rms, for the accuracy to say something."""
        return self.truth_rms >= LEAST_TRUTH_RMS

    def to_dict(self) -> dict[str, Any]:
        """Return the two numbers, the accuracy [%], and whether it means something."""
        return {
            "rmse": self.rmse,
            "truth_rms": self.truth_rms,
            "accuracy": self.accuracy,
            "accuracy_meaningful": self.accuracy_meaningful,
        }


def match(estimate: Array, truth: Array) -> Match:
    """Compare two arrays of one shape, all elements pooled."""
    return Match(rms(estimate - truth), rms(truth))


def rms(values: Array) -> float:
    """Root mean square of all elements, in their unit."""
    return float(np.sqrt(np.mean(np.square(values))))
