"""Latencies in the loop: an estimate that arrives late, and a damper command that does."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from cosim.loop import SensorBlock

Array = npt.NDArray[np.float64]


class LateSensor:
    """A sensor whose estimate is `samples` old when the controller gets it.

    `estimate` and `deviation` (4,) [m/s] are those that have arrived, NaN before the first.
    """

    def __init__(self, sensor: SensorBlock, samples: int) -> None:
        self._sensor, self._samples = sensor, samples
        self._estimates = np.full((samples + 1, 4), np.nan)
        self._deviations = np.full((samples + 1, 4), np.nan)
        self._valid = [False] * (samples + 1)
        self._k = 0
        self.estimate = np.full(4, np.nan)
        self.deviation = np.full(4, np.nan)

    def step(self, measured: Array, command: Array) -> bool:
        """Take one sample (14,) and the command (4,); return whether the estimate that arrives now
        is valid.
        """
        row = self._k % (self._samples + 1)
        self._valid[row] = self._sensor.step(measured, command)
        self._estimates[row] = self._sensor.estimate
        self._deviations[row] = self._sensor.deviation
        self._k += 1
        oldest = self._k % (self._samples + 1)  # written `samples` steps ago
        self.estimate[:] = self._estimates[oldest]
        self.deviation[:] = self._deviations[oldest]
        return self._valid[oldest]


class PromptDampers:
    """The dampers have the command as soon as it is given."""

    def step(self, command: Array) -> Array:
        """Return `command` itself."""
        return command


class LateDampers:
    """The dampers have a command `samples` after it was given, and `initial` (4,) until then."""

    def __init__(self, samples: int, initial: Array) -> None:
        self._commands = np.tile(np.asarray(initial, dtype=np.float64), (samples + 1, 1))
        self._k = 0
        self._held: Array = self._commands[0].copy()

    def step(self, command: Array) -> Array:
        """Take the command (4,) that is given now; return the one that the dampers hold from now
        on, the same array every time.
        """
        self._commands[self._k % len(self._commands)] = command
        self._k += 1
        self._held[:] = self._commands[self._k % len(self._commands)]
        return self._held
