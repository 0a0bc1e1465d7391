"""One operator of an ONNX graph, without the package `onnx`: what a graph is written from and
known by.
"""

from typing import Any, Final, NamedTuple

FLOAT, INT64, DOUBLE = 1, 7, 11
"""Element types, as onnx.TensorProto numbers them."""
OPSET: Final = 17
IR_VERSION: Final = 8
"""Versions of the operators and of the file format in which graphs are written."""
NONE: Final = ""
"""Name of an input or output that is left out."""


class Operation(NamedTuple):
    """Operator, names of its inputs and outputs, attributes."""

    kind: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    attributes: dict[str, Any]


def operation(kind: str, inputs: str, outputs: str, **attributes: Any) -> Operation:
    """Return an operation, its names given with blanks between them."""
    return Operation(kind, tuple(inputs.split()), tuple(outputs.split()), attributes)
