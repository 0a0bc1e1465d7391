"""Linearisation of an FMU by finite differences on its saved state.

One internal step of a second-order method takes a deviation x to (I + eA + (eA)^2 / 2) x. Two step
sizes e and e/2 give A without the square, the same way B; outputs belong to the state at the end
of a step, which gives C and D.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.fmi import Description, Slave, Value
from cosim.linearise.model import LinearModel
from cosim.linearise.state import StateLayout

Array = npt.NDArray[np.float64]

STEP = 1e-4  # e [s]: one internal step, long against round-off
CHANGE = 1e-6  # of a coordinate, or relative for those above 1


@dataclass(frozen=True)
class Transition:
    """What one step makes of a state: its end and the outputs there."""

    words: Array
    outputs: Array


class Steps:
    """Single steps of one instance, from any state and with any inputs."""

    def __init__(
        self,
        description: Description,
        start: Mapping[str, Value],
        inputs: Mapping[str, float],
        outputs: Sequence[str],
    ) -> None:
        self.layout = StateLayout(description.path)
        self._slave = Slave(description, tuple(inputs), tuple(outputs))
        try:
            self.inputs: Array = np.array(list(inputs.values()), dtype=np.float64)
            self._slave.inputs[:] = self.inputs
            self._slave.initialise(dict(start))
            self._saved = self._slave.save()
        except BaseException:
            self._slave.close()
            raise
        self.words = self.layout.read(self._saved)

    def __enter__(self) -> Steps:
        return self

    def __exit__(self, *_: object) -> None:
        self._slave.close()

    def step(self, words: Array, inputs: Array, e: float) -> Transition:
        """Step by e [s] from the state `words` with `inputs` held."""
        self._slave.restore(self.layout.write(self._saved, words))
        self._slave.inputs[:] = inputs
        self._slave.step(0, e)
        self._slave.read()
        return Transition(self.layout.read(self._slave.save()), self._slave.outputs.copy())


@dataclass(frozen=True)
class Slopes:
    """Derivatives of a step of length e: state and outputs by state, state and outputs by input."""

    xx: Array
    yx: Array
    xu: Array
    yu: Array


def linearise(
    description: Description,
    start: Mapping[str, Value],
    inputs: Mapping[str, float],
    outputs: Sequence[str],
) -> LinearModel:
    """Return the FMU linearised where it stands after initialisation with `start`.

    `inputs` are the FMU's inputs by name with the values they have there; all states are kept, in
    the order of `StateLayout.coordinates`. Raises `FmuError` if the FMU fails or does not tell the
    layout of its state.
    """
    limits = [_limits(description, name) for name in inputs]
    with Steps(description, start, inputs, outputs) as steps:
        whole, half = (_slopes(steps, e, limits) for e in (STEP, 0.5 * STEP))
    n = len(steps.layout.coordinates)
    A = _rate(whole.xx - np.eye(n), half.xx - np.eye(n))
    B = _rate(whole.xu, half.xu)
    C = half.yx @ np.linalg.pinv(half.xx)  # a state that a limit holds has a line of zeros
    D = half.yu - C @ half.xu
    return LinearModel(A, B, C, D, steps.layout.coordinates, tuple(inputs), tuple(outputs))


def _rate(whole: Array, half: Array) -> Array:
    return np.asarray((4.0 * half - whole) / STEP)


def _limits(description: Description, name: str) -> tuple[float, float]:
    variable = description.variables[name]
    low, high = (None if v is None else float(v) for v in (variable.min, variable.max))
    return (-np.inf if low is None else low, np.inf if high is None else high)


def _slopes(steps: Steps, e: float, limits: Sequence[tuple[float, float]]) -> Slopes:
    layout, x0, u0 = steps.layout, steps.words, steps.inputs

    def slope(ends: Sequence[Transition], change: float) -> tuple[Array, Array]:
        first, second = ends
        state = layout.difference(second.words, middle) - layout.difference(first.words, middle)
        return state / change, (second.outputs - first.outputs) / change

    middle = steps.step(x0, u0, e).words
    by_state, by_input = [], []
    sizes = np.maximum(1.0, np.abs(layout.sizes(x0)))
    for i, size in enumerate(sizes):
        by = CHANGE * float(size)
        ends = [steps.step(layout.moved(x0, i, sign * by), u0, e) for sign in (-1.0, 1.0)]
        by_state.append(slope(ends, 2.0 * by))
    for i, (low, high) in enumerate(limits):
        places = [max(u0[i] - CHANGE, low), min(u0[i] + CHANGE, high)]
        ends = []
        for place in places:
            u = u0.copy()
            u[i] = place
            ends.append(steps.step(x0, u, e))
        by_input.append(slope(ends, places[1] - places[0]))
    return Slopes(*_columns(by_state), *_columns(by_input))


def _columns(pairs: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    return np.column_stack([p[0] for p in pairs]), np.column_stack([p[1] for p in pairs])
