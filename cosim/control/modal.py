"""Full-car skyhook on the body's three modes: heave, roll and pitch damped each for itself.

The body shall feel the heave force -heave * v_z and the moments -roll * dphi/dt and -pitch *
dtheta/dt as from the sky. Three demands do not determine four corner forces; of all that meet them
the least in the sum of squares is taken (Moore-Penrose inverse), which is the one without warp, the
mode (+,-,-,+) that moves no rigid body. Each damper then comes as near to its share as it can.
After Ikenaga, Lewis, Campos & Davis, Active suspension control of ground vehicle based on a
full-vehicle model, Proc. American Control Conf. (2000), whose heave, roll and pitch loops and
decoupling they are; semi-active by the damper's map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.control.body import Body
from cosim.control.damper_map import DamperMap

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ModalGains:
    """Damping of the modes against the sky: heave [N s/m], roll and pitch [N m s/rad]."""

    heave: float = 14000.0
    roll: float = 9200.0
    pitch: float = 25000.0


class ModalSkyhook:
    """Skyhook on the modes, distributed to the corners."""

    def __init__(self, dampers: DamperMap, mixing: Array, gains: ModalGains | None = None) -> None:
        """`mixing` (4, 3) takes the modes' velocities to the corners'."""
        gains = gains or ModalGains()
        self._dampers = dampers
        self.shares = np.linalg.pinv(mixing.T) * [gains.heave, gains.roll, gains.pitch]
        self._wanted = np.zeros(4)

    def __call__(self, body: Body, relative: Array, deviation: Array, out: Array) -> None:
        """Write the commands (4,) to `out`; see `cosim.control.law.Law`."""
        np.matmul(self.shares, body.modes, out=self._wanted)
        self._dampers.commands(self._wanted, relative, out)
