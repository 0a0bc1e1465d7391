"""The force of the adjustable dampers, as a controller knows it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class DamperMap:
    """Forces of the semi-active damper at the front wheel [N] over speed [m/s]: command 0 and
    command 1.

    The figures are the vehicle FMU's defaults (parameters Damp.Soft*, Damp.Hard*); linear between
    the points and beyond the last. `scale` (4,) multiplies the force at FL FR RL RR.
    """

    speed: tuple[float, ...] = (0.0, 0.05, 0.1, 0.25, 0.5, 1.0)
    soft_rebound: tuple[float, ...] = (0.0, 110.0, 190.0, 330.0, 560.0, 1000.0)
    soft_compression: tuple[float, ...] = (0.0, 65.0, 120.0, 230.0, 380.0, 650.0)
    hard_rebound: tuple[float, ...] = (0.0, 900.0, 1500.0, 2350.0, 3300.0, 4900.0)
    hard_compression: tuple[float, ...] = (0.0, 520.0, 900.0, 1550.0, 2150.0, 3000.0)
    scale: tuple[float, float, float, float] = (1.0, 1.0, 1.33, 1.33)


def damper_map(parameters: Mapping[str, object]) -> DamperMap:
    """Return the map of the vehicle FMU's parameters Damp.*; the rest keeps its default."""
    default = DamperMap()

    def forces(name: str, values: tuple[float, ...]) -> tuple[float, ...]:
        read = (parameters.get(f"Damp.{name}{i}", values[i]) for i in range(1, len(values)))
        return (0.0, *(float(str(force)) for force in read))

    corners = zip(("FL", "FR", "RL", "RR"), default.scale, strict=True)
    fl, fr, rl, rr = (float(str(parameters.get(f"Damp.Scale{c}", s))) for c, s in corners)
    return DamperMap(
        default.speed,
        forces("SoftRebound", default.soft_rebound),
        forces("SoftCompression", default.soft_compression),
        forces("HardRebound", default.hard_rebound),
        forces("HardCompression", default.hard_compression),
        (fl, fr, rl, rr),
    )


def tables(d: DamperMap) -> tuple[Array, Array, Array]:
    """Return speed, soft and hard force from full compression to full rebound, ends extended to 5
    m/s.
    """
    far = 5.0

    def extended(values: tuple[float, ...]) -> list[float]:
        slope = (values[-1] - values[-2]) / (d.speed[-1] - d.speed[-2])
        return [*values, values[-1] + slope * (far - d.speed[-1])]

    def joined(compression: tuple[float, ...], rebound: tuple[float, ...]) -> Array:
        return np.array([-v for v in extended(compression)[:0:-1]] + extended(rebound))

    speed = (*d.speed, far)
    both = np.array([-v for v in speed[:0:-1]] + list(speed))
    return (
        both,
        joined(d.soft_compression, d.soft_rebound),
        joined(d.hard_compression, d.hard_rebound),
    )
