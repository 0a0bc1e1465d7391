"""Skyhook: the damper that would hang between body and sky, as far as a real one can stand for it.

Karnopp, Crosby & Harwood, Vibration control using semi-active force generators, J. Eng. Ind. 96
(1974): the force gain * v_body where it resists the damper's own motion (body velocity, upward, and
suspension velocity, extension, of one sign), the least one elsewhere. The two-state form knows soft
and hard alone (Savaresi, Poussot-Vassal, Spelta, Sename & Dugard, Semi-active suspension control
design for vehicles, 2010, chapter 6).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.control.body import Body
from cosim.control.damper_map import DamperMap

Array = npt.NDArray[np.float64]

SKYHOOK_GAIN: Final = 3500.0  # N s/m, between comfort and tyre load: docs/closed-loop.md
HARD_COMMAND: Final = 0.3  # two states; harder ones lose comfort: docs/closed-loop.md


class Skyhook:
    """Continuous skyhook: each damper comes as near to gain * v_body as its map lets it."""

    def __init__(self, dampers: DamperMap, gain: float = SKYHOOK_GAIN) -> None:
        self._dampers, self._gain = dampers, gain
        self._wanted = np.zeros(4)

    def __call__(self, body: Body, relative: Array, deviation: Array, out: Array) -> None:
        """Write the commands (4,) to `out`; see `cosim.control.law.Law`."""
        np.multiply(self._gain, body.velocity, out=self._wanted)
        self._dampers.commands(self._wanted, relative, out)


class TwoStateSkyhook:
    """Two-state skyhook: `hard` where the damper would slow the body down, else soft."""

    def __init__(self, hard: float = HARD_COMMAND) -> None:
        self._hard = hard

    def __call__(self, body: Body, relative: Array, deviation: Array, out: Array) -> None:
        """Write the commands (4,) to `out`; see `cosim.control.law.Law`."""
        pairs = zip(body.velocity.tolist(), relative.tolist(), strict=True)
        for i, (velocity, extension) in enumerate(pairs):
            out[i] = self._hard if velocity * extension > 0.0 else 0.0
