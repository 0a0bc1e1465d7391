"""Dampers at one command."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.control.sample import Sample

Array = npt.NDArray[np.float64]


class FixedDampers:
    """Every damper at one command, whatever happens."""

    def __init__(self, command: float = 0.0) -> None:
        self.command = np.full(4, command)

    def step(self, sample: Sample) -> Array:
        """Return the constant command (4,)."""
        return self.command
