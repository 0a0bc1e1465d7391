"""What tests of the controllers share: samples, and bodies that move as they are told."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.control.body import Body
from cosim.control.sample import Sample

Array = npt.NDArray[np.float64]


def sample(
    measured: Array | None = None,
    estimate: Array | None = None,
    valid: bool = False,
    truth: Array | None = None,
    deviation: Array | None = None,
) -> Sample:
    """What is known of a car that stands still, but for what is given."""
    nan = np.full(4, np.nan)
    return Sample().renewed(
        np.zeros(14) if measured is None else measured,
        nan if estimate is None else estimate,
        nan if deviation is None else deviation,
        valid,
        np.zeros(4) if truth is None else truth,
    )


class Told(Body):
    """A body whose corners and modes move as they are told, whatever is measured."""

    def __init__(
        self, velocity: Array, acceleration: Array | None = None, modes: Array | None = None
    ) -> None:
        super().__init__()
        self.velocity[:] = velocity
        self.acceleration[:] = 0.0 if acceleration is None else acceleration
        self.modes[:] = 0.0 if modes is None else modes

    def step(self, measured: Array) -> None:
        """Stay as told."""
