"""A backward direction that is written out as what it is at the last sample: one cell from zero
state.

output gate * tanh(input gate * tanh(candidate)), each a third of a layer on the last sample, in any
order.
"""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sensor.errors import SensorError
from sensor.packed.graph import described
from sensor.packed.onnx_file import Node
from sensor.packed.signal import Signal, Value

Array = npt.NDArray[Any]

_BENT: Final = {
    ("Sigmoid", "gates"): "open", ("Tanh", "gates"): "candidate", ("Tanh", "inner"): "bounded",
}  # fmt: skip
_PRODUCTS: Final = {
    frozenset(("open", "candidate")): "inner",
    frozenset(("open", "bounded")): "state",
}


class BackwardCell:
    """Follows the cell, and puts the layer `backward_W`, `backward_B` into the order input, cell,
    output.
    """

    def __init__(self, window: int, arrays: dict[str, Array]) -> None:
        self._window, self._arrays = window, arrays
        self._gates: dict[str, Array] = {}

    def takes(self, node: Node, values: list[Value | None]) -> bool:
        """Whether the operator may be one of the cell's."""
        signals = [value for value in values if isinstance(value, Signal)]
        return node.kind in ("Sigmoid", "Tanh") or (node.kind == "Mul" and len(signals) == 2)

    def results(self, node: Node, values: list[Any]) -> list[Value]:
        """Return the operator's result. Raises SensorError if it does not belong to the cell."""
        if node.kind != "Mul":
            x = values[0]
            kind = _BENT.get((node.kind, getattr(x, "kind", "")))
            if kind is None or not x.plain:
                raise SensorError(f"{described(node)} stands where none is supported.")
            return [Signal.of(kind, x.elements)]
        kinds = frozenset(value.kind for value in values)
        if kinds not in _PRODUCTS or len(values[0].elements) != 1:
            raise SensorError(f"{described(node)} of two signals is not supported there.")
        gate, other = sorted(values, key=lambda value: value.kind != "open")
        units = gate.elements.size
        if _PRODUCTS[kinds] == "inner":
            self._gates = {"input": np.ravel(gate.elements), "cell": np.ravel(other.elements)}
            return [Signal.of("inner", np.arange(units)[np.newaxis])]
        self._order(node, np.ravel(gate.elements))
        first = (2 * (self._window - 1) + 1) * units
        return [Signal.of("state", np.arange(first, first + units)[np.newaxis])]

    def _order(self, node: Node, output: Array) -> None:
        order = np.concatenate([self._gates["input"], self._gates["cell"], output])
        if not np.array_equal(np.sort(order), np.arange(len(self._arrays["backward_B"]))):
            raise SensorError(
                f"{described(node)}: the backward cell's gates are not three of one layer."
            )
        for part in ("W", "B"):
            self._arrays[f"backward_{part}"] = self._arrays[f"backward_{part}"][order]
