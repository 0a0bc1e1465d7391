"""When a fault acts, and how strongly."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

from sensor.channels import SAMPLE_RATE_HZ


@dataclass(frozen=True)
class Window:
    """Samples `first` <= k < `stop`; `ramp` samples from nothing to full size, and back."""

    first: int = 0
    stop: int = sys.maxsize
    ramp: float = 0.0

    @classmethod
    def of(cls, start_s: float, end_s: float | None, ramp_s: float = 0.0) -> Window:
        """Return the samples at start_s <= t_k < end_s [s]; without an end up to the last one."""
        stop = sys.maxsize if end_s is None else _sample(end_s)
        return cls(_sample(start_s), stop, ramp_s * SAMPLE_RATE_HZ)

    def weight(self, k: int) -> float:
        """Return 0 outside, 1 at full size, and a value between on a ramp."""
        if not self.first <= k < self.stop:
            return 0.0
        if not self.ramp:
            return 1.0
        return min((k - self.first) / self.ramp, (self.stop - k) / self.ramp, 1.0)


def _sample(time_s: float) -> int:
    """Return the first sample at or after a time, which decimal digits hardly ever hit exactly."""
    return math.ceil(time_s * SAMPLE_RATE_HZ - 1e-6)
