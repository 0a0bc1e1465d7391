"""An ONNX graph to walk through: operators with their defaults left out, constants as arrays."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy.typing as npt

from sensor.errors import SensorError
from sensor.packed.onnx_file import Model, Node, Port, Tensor
from sensor.packed.tensors import array_of

Array = npt.NDArray[Any]

_DEFAULTS: Final[dict[str, dict[str, Any]]] = {
    "Gemm": {"alpha": 1.0, "beta": 1.0, "transA": 0, "transB": 0},
    "LSTM": {"direction": "forward", "layout": 0, "input_forget": 0},
    "Gather": {"axis": 0},
    "Reshape": {"allowzero": 0},
    "Split": {"axis": 0},
    "Flatten": {"axis": 1},
    "ReduceMean": {"keepdims": 1, "noop_with_empty_axes": 0},
    "Cast": {"saturate": 1},
}
_IGNORED: Final = {"hidden_size", "num_outputs"}  # follow from the shapes


@dataclass(frozen=True)
class Graph:
    """Operators in an order in which each finds its inputs, who makes which value, constants."""

    nodes: tuple[Node, ...]
    producers: Mapping[str, Node]
    constants: Mapping[str, Array]
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]


def graph_of(model: Model) -> Graph:
    """Return a file's graph. Raises SensorError naming what no sensor's network has."""
    if model.external:
        raise SensorError(
            f"its weights lie in another file ({model.external[0]!r} first), where they belong"
            " inside."
        )
    for node in model.nodes:
        if node.domain not in ("", "ai.onnx"):
            raise SensorError(f"operator {node.domain}.{node.kind} is not supported.")
        if not node.outputs:
            raise SensorError(f"{described(node)} has no output.")
    constants = {name: array_of(tensor) for name, tensor in model.tensors.items()}
    nodes = []
    for node in model.nodes:
        if node.kind == "Constant":
            constants[node.outputs[0]] = _constant(node)
        else:
            nodes.append(node)
    producers = {name: node for node in nodes for name in node.outputs if name}
    return Graph(tuple(nodes), producers, constants, tuple(model.inputs), tuple(model.outputs))


def attributes(kind: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes that say something: no defaults, nothing that follows from shapes."""
    defaults = _DEFAULTS.get(kind, {})
    return {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in given.items()
        if name not in _IGNORED and not (name in defaults and defaults[name] == value)
    }


def described(node: Node) -> str:
    """Return how an operator is named in a message."""
    return f"operator {node.kind}" + (f" ({node.name!r})" if node.name else "")


def _constant(node: Node) -> Array:
    value = next(iter(node.attributes.values()), None)
    if not isinstance(value, Tensor):
        raise SensorError(f"{described(node)} holds no tensor, which is not supported.")
    return array_of(value)
