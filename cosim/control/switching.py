"""Dampers that switch at random, for training data."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.control.sample import Sample

Array = npt.NDArray[np.float64]


class SwitchingDampers:
    """Each damper at a random command for a random while: what training data need to know of.

    A command lies in 0..1 with the ends as likely as all between; it holds for 0.05 to 1 s.
    """

    def __init__(self, seed: int, step_s: float) -> None:
        self.command = np.zeros(4)
        self._random = np.random.default_rng(seed)
        self._left = [0, 0, 0, 0]
        self._h = step_s

    def step(self, sample: Sample) -> Array:
        """Return the commands of this sample (4,)."""
        for i in range(4):
            if self._left[i] == 0:
                self._left[i] = round(self._random.uniform(0.05, 1.0) / self._h)
                self.command[i] = min(max(self._random.uniform(-0.5, 1.5), 0.0), 1.0)
            self._left[i] -= 1
        return self.command
