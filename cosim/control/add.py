"""Acceleration-driven damping, alone and mixed with skyhook: two states, chosen wheel by wheel.

ADD: Savaresi, Silani & Bittanti, Acceleration-driven-damper (ADD): an optimal control algorithm for
comfort-oriented semiactive suspensions, ASME J. Dyn. Syst. Meas. Control 127 (2005): hard where the
body's acceleration and the suspension velocity have one sign. It is the best switching rule one
sample ahead, needs no velocity of the body, and filters best above the body's resonance.

SH-ADD: Savaresi & Spelta, Mixed sky-hook and ADD: approaching the filtering limits of a semi-active
suspension, ibid. 129 (2007): skyhook while acceleration^2 <= alpha^2 velocity^2, else ADD. At
the frequency alpha / (2 pi) a harmonic motion spends half of its time in either.
"""

from __future__ import annotations

from math import pi
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.control.body import Body
from cosim.control.skyhook import HARD_COMMAND

Array = npt.NDArray[np.float64]

CROSSOVER_HZ: Final = 1.9  # sqrt(2) times the body's resonance, where both laws filter alike


class Add:
    """Acceleration-driven damping; `hard` is the command of the hard state."""

    def __init__(self, hard: float = HARD_COMMAND) -> None:
        self._hard = hard

    def __call__(self, body: Body, relative: Array, deviation: Array, out: Array) -> None:
        """Write the commands (4,) to `out`; see `cosim.control.law.Law`."""
        pairs = zip(body.acceleration.tolist(), relative.tolist(), strict=True)
        for i, (acceleration, extension) in enumerate(pairs):
            out[i] = self._hard if acceleration * extension > 0.0 else 0.0


class SkyhookAdd:
    """SH-ADD; `hard` is the command of the hard state, `crossover` alpha / 2 pi [Hz]."""

    def __init__(self, hard: float = HARD_COMMAND, crossover: float = CROSSOVER_HZ) -> None:
        self._hard, self._alpha = hard, 2.0 * pi * crossover

    def __call__(self, body: Body, relative: Array, deviation: Array, out: Array) -> None:
        """Write the commands (4,) to `out`; see `cosim.control.law.Law`."""
        motion = zip(
            body.velocity.tolist(), body.acceleration.tolist(), relative.tolist(), strict=True
        )
        for i, (velocity, acceleration, extension) in enumerate(motion):
            slow = abs(acceleration) <= self._alpha * abs(velocity)
            chosen = velocity if slow else acceleration
            out[i] = self._hard if chosen * extension > 0.0 else 0.0
