"""Cautious skyhook: the command that comes nearest to the skyhook's force on the average.

An estimate is one of many velocities that the suspension may have: v_rel = estimate + error. Under
a command u the damper's force is soft(v_rel) + u span(v_rel). The expected square of its distance
to the wanted force gain * v_body is least for

    u = E[span (wanted - soft)] / E[span^2],  between 0 and 1,

the expectation taken over a normally distributed error of the deviation that the sensor predicts.
Where it knows the velocity this is skyhook (Karnopp, Crosby & Harwood 1974); the less it knows, the
less a damper is hardened for a force that may have the wrong sign. To weigh what is not known by
its expected cost is what Astrom & Wittenmark (Adaptive control, 2nd ed. 1995) call cautious.

A deviation of at least `least` counts, also on the truth: a hard damper nearly at rest makes force
out of millimetres per second, and its velocity has changed its sign before the valve has moved.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.control.body import Body
from cosim.control.damper_map import DamperMap

Array = npt.NDArray[np.float64]

CAUTIOUS_GAIN: Final = 4500.0  # N s/m: docs/closed-loop.md
LEAST_DEVIATION: Final = 0.05  # m/s: docs/closed-loop.md
_NODES: Final = 9  # of the Gauss-Hermite rule


class CautiousSkyhook:
    """Skyhook that knows how uncertain its estimate is."""

    def __init__(
        self, dampers: DamperMap, gain: float = CAUTIOUS_GAIN, least: float = LEAST_DEVIATION
    ) -> None:
        self._dampers, self._gain, self._least = dampers, gain, least
        nodes, weights = np.polynomial.hermite_e.hermegauss(_NODES)
        self._rule = list(zip(nodes.tolist(), weights.tolist(), strict=True))

    def __call__(self, body: Body, relative: Array, deviation: Array, out: Array) -> None:
        """Write the commands (4,) to `out`; see `cosim.control.law.Law`."""
        known = zip(body.velocity.tolist(), relative.tolist(), deviation.tolist(), strict=True)
        for i, (velocity, estimate, expected) in enumerate(known):
            sigma = expected if expected > self._least else self._least  # NaN: the least
            out[i] = self._command(i, self._gain * velocity, estimate, sigma)

    def _command(self, wheel: int, wanted: float, estimate: float, sigma: float) -> float:
        if sigma == 0.0:
            return self._dampers.command(wheel, wanted, estimate)
        product = square = 0.0
        for node, weight in self._rule:
            soft, hard = self._dampers.ends(wheel, estimate + sigma * node)
            span = hard - soft
            product += weight * span * (wanted - soft)
            square += weight * span * span
        return min(max(product / square, 0.0), 1.0) if square > 0.0 else 0.0
