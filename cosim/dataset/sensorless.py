"""What stands where the sensor belongs."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class NoSensor:
    """Stands where the sensor belongs while the data to train it are driven; never valid."""

    def __init__(self) -> None:
        self.estimate: Array = np.full(4, np.nan)
        self.deviation: Array = np.full(4, np.nan)

    def step(self, measured: Array, command: Array) -> bool:
        """Return False."""
        return False
