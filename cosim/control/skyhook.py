"""Continuous skyhook."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.control.damper_map import DamperMap, tables
from cosim.control.sample import Sample
from sensor.body_motion import BodyMotion

Array = npt.NDArray[np.float64]

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
        self._speed, self._soft, self._hard = tables(dampers)

    def step(self, sample: Sample) -> Array:
        """Return the commands (4,), 0 soft to 1 hard, the same array every time."""
        body = self._body.step(sample.measured)
        if not (self._on_truth or sample.valid):
            return self.command
        relative = sample.truth if self._on_truth else sample.estimate
        soft = np.interp(relative, self._speed, self._soft)
        hard = np.interp(relative, self._speed, self._hard)
        wanted = self._gain / self._scale * body
        span = hard - soft
        np.divide(wanted - soft, span, out=self.command, where=np.abs(span) > 1.0)
        self.command[(body * relative <= 0) | (np.abs(span) <= 1.0)] = 0.0
        np.clip(self.command, 0.0, 1.0, out=self.command)
        return self.command
