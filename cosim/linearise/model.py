"""A linear system with named states, inputs and outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class LinearModel:
    """dx/dt = A x + B u, y = C x + D u: deviations from an operating point, SI units.

    A (n, n), B (n, m), C (p, n), D (p, m); `states`, `inputs` and `outputs` name their lines.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def without_states(self, names: Sequence[str]) -> LinearModel:
        """Return the system with these states held still; "spin" stands for all of "spin.FL" ...

        For coordinates that nothing depends on, such as the place on an even road.
        """
        kept = [
            i for i, s in enumerate(self.states) if s not in names and s.split(".")[0] not in names
        ]
        return replace(
            self,
            A=self.A[np.ix_(kept, kept)],
            B=self.B[kept],
            C=self.C[:, kept],
            states=tuple(self.states[i] for i in kept),
        )

    def with_inputs(self, inputs: Sequence[str], B: Array, D: Array) -> LinearModel:
        """Return the system with more inputs, B (n, k) and D (p, k)."""
        return replace(
            self,
            B=np.hstack([self.B, B]),
            D=np.hstack([self.D, D]),
            inputs=(*self.inputs, *inputs),
        )

    def driven_over_elevation(self, speed: float) -> LinearModel:
        """Return the system at `speed` [m/s] with d(elevation)/dt under each wheel as inputs.

        Elevation and slope under a wheel, the inputs "Road.z.FL" and "Road.slope.FL", belong
        together: the elevation becomes a state, the slope is its rate over the speed. A road of
        ISO 8608's waviness 2 makes those inputs ("Road.zp.FL") white.
        """
        height = [i for i, name in enumerate(self.inputs) if name.startswith("Road.z.")]
        slope = [i for i, name in enumerate(self.inputs) if name.startswith("Road.slope.")]
        other = [i for i in range(len(self.inputs)) if i not in {*height, *slope}]
        n, k = len(self.states), len(height)
        still = np.zeros((k, n + k))
        return LinearModel(
            A=np.vstack([np.hstack([self.A, self.B[:, height]]), still]),
            B=np.block(
                [
                    [self.B[:, other], self.B[:, slope] / speed],
                    [np.zeros((k, len(other))), np.eye(k)],
                ]
            ),
            C=np.hstack([self.C, self.D[:, height]]),
            D=np.hstack([self.D[:, other], self.D[:, slope] / speed]),
            states=(*self.states, *(self.inputs[i] for i in height)),
            inputs=(
                *(self.inputs[i] for i in other),
                *(self.inputs[i].replace(".z.", ".zp.") for i in height),
            ),
            outputs=self.outputs,
        )

    def discretise(self, h: float) -> tuple[Array, Array]:
        """Return (A, B) of the samples h [s] apart, inputs held in between."""
        from scipy.linalg import expm

        n, m = self.B.shape
        whole = np.zeros((n + m, n + m))
        whole[:n, :n], whole[:n, n:] = self.A, self.B
        grown = expm(whole * h)
        return np.asarray(grown[:n, :n]), np.asarray(grown[:n, n:])
