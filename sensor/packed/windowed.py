"""The windowed network in an ONNX graph, of whichever exporter: the operators are walked through
with one window, and what they do with its elements is written down.

Kinds of signals on the way: `sample` (element 14 t + channel), `state` (the LSTM's outputs, element
(2 t + direction) units + unit; direction 1 is the backward one), `gates` of a backward direction
that is written out as one cell, `dense`, `hidden` (behind ReLU), `velocity`.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNELS, OUTPUTS
from sensor.errors import SensorError
from sensor.packed.backward_cell import BackwardCell
from sensor.packed.graph import Graph, described
from sensor.packed.lstm import Lstm
from sensor.packed.onnx_file import Node
from sensor.packed.signal import Signal, Value, affine, constant_of_shape, rearranged
from sensor.packed.standardisation import take_standardisation

Array = npt.NDArray[Any]

_MOVES: Final = {
    *("Transpose", "Reshape", "Squeeze", "Unsqueeze", "Flatten", "Gather", "Expand", "Slice"),
    *("Split", "Concat", "Identity", "Dropout"),
}
_AFFINE: Final = {"Add", "Sub", "Mul", "Div"}
_FLOAT: Final = 1


class WindowedWalk:
    """One pass through a graph, from the value `start` (1, W, 14) to its output; `arrays` then
    holds the network's, by the names of `PackedNetwork`.
    """

    def __init__(self, graph: Graph, start: str, window: int) -> None:
        self._graph, self._window = graph, window
        self.arrays: dict[str, Array] = {}
        elements = np.arange(window * len(CHANNELS)).reshape(1, window, len(CHANNELS))
        self._values: dict[str, Value | None] = dict(graph.constants)
        self._values[start] = Signal.of("sample", elements)
        self._lstm = Lstm(window, self.arrays)
        self._cell = BackwardCell(window, self.arrays)

    def run(self, skipped: set[str]) -> None:
        """Walk through all operators but those whose result is in `skipped`.

        Raises SensorError naming the first operator or shape that no such network has.
        """
        for node in self._graph.nodes:
            if skipped.intersection(node.outputs):
                continue
            if not node.inputs or not node.inputs[0]:
                raise SensorError(f"{described(node)} has no input.")
            values = [self._values.get(name) if name else None for name in node.inputs]
            for name, value in zip(node.inputs, values, strict=True):
                if name and value is None:
                    raise SensorError(f"{described(node)} takes {name!r}, which is not supported.")
            self._values.update(zip(node.outputs, self._results(node, values), strict=False))
        self._finish()

    def _results(self, node: Node, values: list[Value | None]) -> list[Value]:
        rules: Mapping[str, Callable[[Node, list[Any]], list[Value]]] = {
            "LSTM": self._lstm.results, "Gemm": self._gemm, "MatMul": self._gemm,
            "Relu": self._relu, "Shape": self._shape, "Cast": self._cast,
            "ConstantOfShape": self._constant,
        }  # fmt: skip
        try:
            if self._cell.takes(node, values):
                return self._cell.results(node, values)
            if node.kind in rules:
                return rules[node.kind](node, values)
            if node.kind in _MOVES:
                return rearranged(node, values)
            if node.kind in _AFFINE:
                return [affine(node, *values)]  # type: ignore[arg-type]
        except (ValueError, IndexError, TypeError) as error:
            if isinstance(error, SensorError):
                raise
            raise SensorError(f"{described(node)} does not fit its inputs: {error}.") from error
        raise SensorError(f"{described(node)} is not supported.")

    def _shape(self, node: Node, values: list[Any]) -> list[Value]:
        x = values[0]
        shape = (x.elements if isinstance(x, Signal) else x).shape
        return [np.array(shape[node.attributes.get("start", 0) : node.attributes.get("end")])]

    def _constant(self, node: Node, values: list[Any]) -> list[Value]:
        return [constant_of_shape(node, values[0])]

    def _cast(self, node: Node, values: list[Any]) -> list[Value]:
        if isinstance(values[0], Signal) and node.attributes.get("to") != _FLOAT:
            raise SensorError(f"{described(node)} to another type than float32 is not supported.")
        return [values[0]]

    def _relu(self, node: Node, values: list[Any]) -> list[Value]:
        x = values[0]
        if not isinstance(x, Signal) or x.kind != "dense":
            raise SensorError(f"{described(node)} stands where none is supported.")
        if not np.all(x.scale == 1.0):
            raise SensorError(f"{described(node)} of a scaled layer is not supported.")
        bias = self.arrays["dense_B"]
        bias[np.ravel(x.elements)] += np.ravel(x.offset).astype(np.float32)
        return [Signal.of("hidden", x.elements)]

    def _gemm(self, node: Node, values: list[Any]) -> list[Value]:
        """A layer: its columns are put in order of the elements that they multiply."""
        x, weight = values[0], values[1]
        if not isinstance(x, Signal) or isinstance(weight, Signal):
            raise SensorError(f"{described(node)} with computed weights is not supported.")
        kinds = {
            "sample": ("backward", "gates"),
            "state": ("dense", "dense"),
            "hidden": ("output", "velocity"),
        }
        if x.kind not in kinds or f"{kinds[x.kind][0]}_W" in self.arrays:
            raise SensorError(f"{described(node)} stands where no further layer is supported.")
        weight, bias = _layer(node, weight, values[2] if len(values) > 2 else None)
        elements, scale, offset = np.ravel(x.elements), np.ravel(x.scale), np.ravel(x.offset)
        name, result = kinds[x.kind]
        if x.kind == "sample":
            take_standardisation(self.arrays, scale, offset)
        else:
            weight, bias = weight * scale, bias + weight @ offset
        self.arrays[f"{name}_W"] = self._ordered(node, x.kind, weight, elements).astype(np.float32)
        self.arrays[f"{name}_B"] = bias.astype(np.float32)
        return [Signal.of(result, np.arange(len(weight))[np.newaxis])]

    def _ordered(self, node: Node, kind: str, weight: Array, elements: Array) -> Array:
        """Return the columns in the order of the network's own vector."""
        if kind == "sample":
            first = (self._window - 1) * len(CHANNELS)
            order, what = np.arange(first, first + len(CHANNELS)), "the last sample"
        elif kind == "state" and "forward_R" in self.arrays:
            units = self.arrays["forward_R"].shape[1]
            first = 2 * (self._window - 1) * units
            order, what = np.arange(first, first + 2 * units), "both directions at the last sample"
        elif kind == "state":
            raise SensorError("the forward direction of its LSTM comes after its dense layer.")
        else:
            order, what = np.arange(len(self.arrays["dense_B"])), "the dense layer"
        if not np.array_equal(np.sort(elements), order):
            raise SensorError(
                f"{described(node)} does not read {what}, which is all that is supported."
            )
        return weight[:, np.argsort(elements)]

    def _finish(self) -> None:
        """Take over what is multiplied and added at the end: the outputs' deviation and mean."""
        result = self._values.get(self._graph.outputs[0].name)
        if not isinstance(result, Signal) or result.kind != "velocity":
            raise SensorError("its output is none of two dense layers with ReLU between them.")
        elements = np.ravel(result.elements)
        if not np.array_equal(elements, np.arange(len(OUTPUTS))):
            raise SensorError(
                f"its output has {elements.size} values, where {len(OUTPUTS)} belong."
            )
        self.arrays["output_std"] = np.ravel(result.scale).astype(np.float32)
        self.arrays["output_mean"] = np.ravel(result.offset).astype(np.float32)


def _layer(node: Node, weight: Array, bias: Array | None) -> tuple[Array, Array]:
    """Return weight (outputs, inputs) and bias (outputs,) in double precision."""
    a = node.attributes
    if a.get("transA", 0):
        raise SensorError(f"{described(node)} with transA is not supported.")
    w = np.asarray(weight, dtype=np.float64) * a.get("alpha", 1.0)
    w = w if a.get("transB", 0) else w.T
    b = (
        np.zeros(len(w))
        if bias is None
        else np.asarray(bias, dtype=np.float64) * a.get("beta", 1.0)
    )
    return w, np.broadcast_to(np.ravel(b), (len(w),))
