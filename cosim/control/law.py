"""A law of semi-active control as a block of the loop."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.control.body import Body
from cosim.control.sample import Sample

Array = npt.NDArray[np.float64]

_EXACT = np.zeros(4)


class Law(Protocol):
    """What is commanded for a motion."""

    def __call__(self, body: Body, relative: Array, deviation: Array, out: Array) -> None:
        """Write the commands (4,), 0 soft to 1 hard, to `out`: from the motion of the body and the
        suspension velocities `relative` (4,) [m/s], positive in extension, FL FR RL RR, with the
        standard `deviation` (4,) [m/s] of their errors, NaN where it is not known.
        """


class LawController:
    """Applies a law to the true or the estimated suspension velocities.

    The body's motion comes from the measured channels, also while no estimate is valid, so that
    its filters have settled when the first one is. Until then the commands stay at `initial`, and
    at the last ones while the estimate is not valid.
    """

    def __init__(
        self, law: Law, on_truth: bool, initial: float = 0.0, body: Body | None = None
    ) -> None:
        self.command = np.full(4, initial)
        self._law, self._on_truth = law, on_truth
        self._body = body or Body()

    def step(self, sample: Sample) -> Array:
        """Return the commands (4,), 0 soft to 1 hard, the same array every time."""
        self._body.step(sample.measured)
        if self._on_truth:
            self._law(self._body, sample.truth, _EXACT, self.command)
        elif sample.valid:
            self._law(self._body, sample.estimate, sample.deviation, self.command)
        return self.command
