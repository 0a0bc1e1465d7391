"""Channels that are missing for a while: what stands between a car's messages and an estimator.

An estimator refuses a sample that holds a NaN (SensorError): in a simulation that is a mistake, and
should stop it. In a car a message is lost now and then. `HeldSamples` wraps any estimator: a
channel that is NaN or infinite keeps its last value, and after `longest` seconds of that the
estimate does not count until all channels have been back for `settling` seconds.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNELS, OUTPUTS, SAMPLE_RATE_HZ
from sensor.estimator import Estimator, sample_by_sample

Array = npt.NDArray[np.float64]

LONGEST: Final = 0.1
"""Time [s] for which a held channel does little harm: docs/robustness.md."""
SETTLING: Final = 2.0
"""Time [s] after which nearly every error is its usual one again in production:
docs/robustness.md.
"""


class HeldSamples:
    """An estimator for samples with gaps.

    `estimate` and `deviation` (4,) [m/s] are the same arrays at every step, NaN where they do not
    count. `missing` (14,) tells which channels the last sample lacked.
    """

    def __init__(
        self, estimator: Estimator, longest: float = LONGEST, settling: float = SETTLING
    ) -> None:
        self._estimator = estimator
        self._longest = round(longest * SAMPLE_RATE_HZ)
        self._settling = round(settling * SAMPLE_RATE_HZ)
        self._held = np.zeros(len(CHANNELS))
        self.missing = np.ones(len(CHANNELS), dtype=np.bool_)
        self._seen = np.zeros(len(CHANNELS), dtype=np.bool_)
        self._lacking = self._waiting = 0
        self.estimate = np.full(len(OUTPUTS), np.nan)
        self.deviation = np.full(len(OUTPUTS), np.nan)

    def reset(self) -> None:
        """Forget all samples."""
        self._estimator.reset()
        self._seen.fill(False)
        self.missing.fill(True)
        self._lacking = self._waiting = 0
        self._invalid()

    def step(self, measured: Array, command: Array) -> bool:
        """Take one sample (14,) in SI units, NaN where a channel is missing, and the damper command
        (4,) held until it; return whether the estimate counts.

        Until every channel has come once nothing is estimated.
        """
        np.isfinite(measured, out=self.missing)
        np.copyto(self._held, measured, where=self.missing)
        self._seen |= self.missing
        np.logical_not(self.missing, out=self.missing)
        if not self._seen.all():
            return False
        self._lacking = self._lacking + 1 if self.missing.any() else 0
        self._waiting = max(self._waiting - 1, 0)
        if self._lacking > self._longest:
            self._waiting = self._settling
        valid = self._estimator.step(self._held, command) and self._waiting == 0
        if valid:
            self.estimate[:] = self._estimator.estimate
            self.deviation[:] = self._estimator.deviation
        else:
            self._invalid()
        return valid

    def apply(self, channels: Array, commands: Array) -> Array:
        """Estimate a whole run from a fresh start: channels (samples, 14), NaN where missing, and
        commands (samples, 4) -> (samples, 4) [m/s], NaN where it does not count; `step`'s state is
        lost.
        """
        return self.apply_with_deviation(channels, commands)[0]

    def apply_with_deviation(self, channels: Array, commands: Array) -> tuple[Array, Array]:
        """Return estimates and deviations (samples, 4) [m/s] of a whole run, as `apply` does."""
        return sample_by_sample(self, channels, commands)

    def _invalid(self) -> None:
        self.estimate.fill(np.nan)
        self.deviation.fill(np.nan)
