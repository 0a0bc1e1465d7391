"""Hybrid of skyhook and groundhook: comfort and tyre load, weighed against each other.

Valasek, Novak, Sika & Vaculin, Extended ground-hook - new concept of semi-active control of truck's
suspension, Veh. Syst. Dyn. 27 (1997), for the groundhook; the sum as in Ahmadian & Pare, A
quarter-car experimental analysis of alternative semiactive control methods, J. Intell. Mater. Syst.
Struct. 11 (2000): F = gain (share * sky + (1 - share) * ground), where sky is v_body and ground is
-v_wheel, each only as long as the damper resists its own motion with it.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.control.body import Body
from cosim.control.damper_map import DamperMap
from cosim.control.skyhook import SKYHOOK_GAIN

Array = npt.NDArray[np.float64]

SKYHOOK_SHARE: Final = 0.5


class Hybrid:
    """Skyhook for the body and groundhook for the wheel: `share` 1 is skyhook alone, 0 groundhook.

    The wheel's velocity is the body's less the suspension's, v_wheel = v_body - v_rel.
    """

    def __init__(
        self, dampers: DamperMap, gain: float = SKYHOOK_GAIN, share: float = SKYHOOK_SHARE
    ) -> None:
        self._dampers = dampers
        self._sky, self._ground = share * gain, (1.0 - share) * gain

    def __call__(self, body: Body, relative: Array, deviation: Array, out: Array) -> None:
        """Write the commands (4,) to `out`; see `cosim.control.law.Law`."""
        pairs = zip(body.velocity.tolist(), relative.tolist(), strict=True)
        for i, (velocity, extension) in enumerate(pairs):
            wheel = velocity - extension
            sky = self._sky * velocity if velocity * extension > 0.0 else 0.0
            ground = -self._ground * wheel if wheel * extension < 0.0 else 0.0
            out[i] = self._dampers.command(i, sky + ground, extension)
