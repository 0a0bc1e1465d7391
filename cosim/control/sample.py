"""What is known at t_k, for a controller to choose its commands from."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNELS, OUTPUTS

Array = npt.NDArray[np.float64]


class Sample:
    """What is known at t_k; the loop makes one object and renews it at every sample.

    `measured` (14,) the channels as they arrive, SI units, one that is missing with its last value;
    `estimate` (4,) the suspension velocities [m/s], positive in extension, order FL FR RL RR, and
    `deviation` (4,) [m/s] the standard deviation that the sensor expects of their errors, NaN if it
    expects none; `valid` whether the estimate counts; `truth` (4,) [m/s] the true velocities, for
    controllers that a scenario allows to read them (`feedback: truth`) and for no other. The arrays
    are the blocks' own: not to be written to, and other values at the next sample.
    """

    __slots__ = ("deviation", "estimate", "measured", "truth", "valid")

    def __init__(self) -> None:
        self.measured: Array = np.full(len(CHANNELS), np.nan)
        self.estimate: Array = np.full(len(OUTPUTS), np.nan)
        self.deviation: Array = np.full(len(OUTPUTS), np.nan)
        self.valid = False
        self.truth: Array = np.full(len(OUTPUTS), np.nan)

    def renewed(
        self, measured: Array, estimate: Array, deviation: Array, valid: bool, truth: Array
    ) -> Sample:
        """Return this object with what is known now."""
        self.measured, self.valid, self.truth = measured, valid, truth
        self.estimate, self.deviation = estimate, deviation
        return self
