"""The force of the adjustable dampers, as every controller knows it.

The curves are the vehicle's (monotone cubics through its tables, `sensor.kalman.damper`); between
soft and hard the force is in proportion to the command.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from sensor.kalman.damper import Curve
from sensor.kalman.damper import DamperMap as Tables

Array = npt.NDArray[np.float64]

CORNERS = ("FL", "FR", "RL", "RR")
LEAST_SPAN = 1.0  # N; where soft and hard are nearer to each other, no command is better


class DamperMap:
    """Forces of the four dampers at their wheels, order FL FR RL RR, in both directions.

    Forces [N] are positive against extension, extension speeds v [m/s] positive in extension, the
    command is 0 soft to 1 hard.
    """

    def __init__(self, tables: Tables | None = None) -> None:
        tables = tables or Tables()
        self.tables = tables
        self._soft, self._hard = Curve(*tables.soft).force, Curve(*tables.hard).force

    def ends(self, wheel: int, v: float) -> tuple[float, float]:
        """Return the forces at an extension speed, soft and hard."""
        scale = self.tables.scale[wheel]
        return scale * self._soft(v)[0], scale * self._hard(v)[0]

    def force(self, wheel: int, v: float, command: float) -> float:
        """Return the force at an extension speed under a command."""
        soft, hard = self.ends(wheel, v)
        return soft + command * (hard - soft)

    def command(self, wheel: int, wanted: float, v: float) -> float:
        """Return the command whose force comes nearest to `wanted` [N] at an extension speed.

        A damper only resists: a force that would push along the motion is met by soft.
        """
        if wanted * v <= 0.0:
            return 0.0
        soft, hard = self.ends(wheel, v)
        span = hard - soft
        if abs(span) <= LEAST_SPAN:
            return 0.0
        return min(max((wanted - soft) / span, 0.0), 1.0)

    def commands(self, wanted: Array, v: Array, out: Array) -> None:
        """Write the commands (4,) for wanted forces (4,) [N] at extension speeds (4,) to `out`."""
        for i, (force, speed) in enumerate(zip(wanted.tolist(), v.tolist(), strict=True)):
            out[i] = self.command(i, force, speed)


def damper_map(parameters: Mapping[str, object]) -> DamperMap:
    """Return the map of the vehicle FMU's parameters Damp.*; the rest keeps its default."""
    default = Tables()

    def table(end: str, usual: tuple[tuple[float, ...], ...]) -> tuple[tuple[float, ...], ...]:
        ways = zip(("Rebound", "Compression"), usual, strict=True)
        return tuple(
            tuple(_number(parameters, f"Damp.{end}{way}{i}", f) for i, f in enumerate(forces, 1))
            for way, forces in ways
        )

    corners = zip(CORNERS, default.scale, strict=True)
    fl, fr, rl, rr = (_number(parameters, f"Damp.Scale{c}", s) for c, s in corners)
    soft, hard = table("Soft", default.soft), table("Hard", default.hard)
    return DamperMap(
        Tables(soft=(soft[0], soft[1]), hard=(hard[0], hard[1]), scale=(fl, fr, rl, rr))
    )


def _number(parameters: Mapping[str, object], name: str, usual: float) -> float:
    return float(str(parameters.get(name, usual)))
