"""The controller block: fixed dampers, randomly switching ones, and continuous skyhook."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.body_motion import BodyMotion

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


def held(commands: Array, initial: Array) -> Array:
    """Return the commands (rows, 4) that were held until each row: a record's `commands` (rows, 4),
    each held from its row on, with `initial` (4,) before them.
    """
    return np.vstack([initial, commands])[: len(commands)]


class FixedDampers:
    """Every damper at one command, whatever happens."""

    def __init__(self, command: float = 0.0) -> None:
        self.command = np.full(4, command)

    def step(self, measured: Array, estimate: Array, valid: bool, truth: Array) -> Array:
        """Return the constant command (4,)."""
        return self.command


class SwitchingDampers:
    """Each damper at a random command for a random while: what training data need to know of.

    A command lies in 0..1 with the ends as likely as all between; it holds for 0.05 to 1 s.
    """

    def __init__(self, seed: int, step_s: float) -> None:
        self.command = np.zeros(4)
        self._random = np.random.default_rng(seed)
        self._left = [0, 0, 0, 0]
        self._h = step_s

    def step(self, measured: Array, estimate: Array, valid: bool, truth: Array) -> Array:
        """Return the commands of this sample (4,)."""
        for i in range(4):
            if self._left[i] == 0:
                self._left[i] = round(self._random.uniform(0.05, 1.0) / self._h)
                self.command[i] = min(max(self._random.uniform(-0.5, 1.5), 0.0), 1.0)
            self._left[i] -= 1
        return self.command


SKYHOOK_GAIN: Final = 3500.0  # N s/m, between comfort and tyre load: docs/closed-loop.md


class Skyhook:
    """Continuous skyhook (Karnopp, Crosby & Harwood, J. Eng. Ind. 96, 1974) on a real damper's map.

    The damper should pull the body with gain * v_body against the sky. It can only resist its own
    motion: where body velocity (upward) and suspension velocity (extension) have one sign it is set
    to the force that comes nearest, elsewhere to soft. v_body is estimated from the channels, v_rel
    is the truth or the sensor's estimate. Until an estimate is valid the commands stay at
    `initial`.
    """

    def __init__(
        self,
        on_truth: bool,
        gain: float | None = None,
        initial: float = 0.0,
        dampers: DamperMap | None = None,
        body: BodyMotion | None = None,
    ) -> None:
        dampers = dampers or DamperMap()
        self.command = np.full(4, initial)
        self._on_truth = on_truth
        self._gain = SKYHOOK_GAIN if gain is None else gain
        self._body = body or BodyMotion()
        self._scale = np.array(dampers.scale)
        self._speed, self._soft, self._hard = _tables(dampers)

    def step(self, measured: Array, estimate: Array, valid: bool, truth: Array) -> Array:
        """Return the commands (4,), 0 soft to 1 hard, the same array every time."""
        body = self._body.step(measured)
        if not (self._on_truth or valid):
            return self.command
        relative = truth if self._on_truth else estimate
        soft = np.interp(relative, self._speed, self._soft)
        hard = np.interp(relative, self._speed, self._hard)
        wanted = self._gain / self._scale * body
        span = hard - soft
        np.divide(wanted - soft, span, out=self.command, where=np.abs(span) > 1.0)
        self.command[(body * relative <= 0) | (np.abs(span) <= 1.0)] = 0.0
        np.clip(self.command, 0.0, 1.0, out=self.command)
        return self.command


def _tables(d: DamperMap) -> tuple[Array, Array, Array]:
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
