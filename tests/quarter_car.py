"""A quarter car whose damper obeys a law: what published figures of the laws are drawn for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from control_rig import Told

from cosim.control.hybrid import Hybrid

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Response:
    """Rms values about the mean under a harmonic road of 1 mm: [m/s2] and [N]."""

    body_acceleration: float
    tyre_force: float


class _Linear:
    """A damper map of two straight lines, the same at each wheel."""

    def __init__(self, least: float, greatest: float) -> None:
        self.least, self.span = least, greatest - least

    def command(self, wheel: int, wanted: float, v: float) -> float:
        """Return the command whose force comes nearest to `wanted`."""
        if wanted * v <= 0.0:
            return 0.0
        return float(np.clip((wanted / v - self.least) / self.span, 0.0, 1.0))


@dataclass(frozen=True)
class QuarterCar:
    """Masses [kg], stiffnesses [N/m], least and greatest damping [N s/m], lag of the damper (a
    bandwidth of 20 Hz) and step [s].
    """

    body: float = 400.0
    wheel: float = 50.0
    spring: float = 20e3
    tyre: float = 250e3
    least: float = 300.0
    greatest: float = 3900.0
    lag: float = 0.008
    step: float = 1e-3

    @staticmethod
    def hybrid(gain: float, share: float) -> Any:
        """Return the hybrid law on this car's damper."""
        dampers: Any = _Linear(QuarterCar.least, QuarterCar.greatest)
        return Hybrid(dampers, gain, share)

    def driven(self, law: Callable[..., None] | float, hz: float) -> Response:
        """Return the response to a road of `hz`; a number for the law is a fixed command."""
        h, w = self.step, 2 * np.pi * hz
        told, out, relative = Told(np.zeros(4)), np.zeros(4), np.zeros(4)
        z = u = dz = du = a = 0.0  # body and wheel: height, velocity; the body's acceleration
        damping, follow = self.least, 1.0 - np.exp(-h / self.lag)
        periods = max(10, round(3 * hz))
        steps = round(periods / hz / h)
        kept = []
        for k in range(steps):
            if isinstance(law, float):
                out[:] = law
            else:
                told.velocity[:], told.acceleration[:], relative[:] = dz, a, dz - du
                law(told, relative, np.zeros(4), out)
            wanted = self.least + out[0] * (self.greatest - self.least)
            damping += follow * (wanted - damping)
            road = 1e-3 * np.sin(w * k * h)
            force = self.spring * (z - u) + damping * (dz - du)
            tyre = self.tyre * (road - u)
            a = -force / self.body
            dz += h * a
            du += h * (force + tyre) / self.wheel
            z += h * dz
            u += h * du
            kept.append((a, tyre))
        late = np.array(kept[len(kept) // 2 :])
        return Response(*(float(v) for v in late.std(axis=0)))
