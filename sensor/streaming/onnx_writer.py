"""An ONNX graph written as what it is, a protocol-buffers message: no package is needed for it.

Field numbers are those of onnx.proto (ModelProto, GraphProto, NodeProto, AttributeProto,
TensorProto, ValueInfoProto).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sensor.operation import DOUBLE, FLOAT, INT64, IR_VERSION, OPSET, Operation

_ELEMENT: Final = {"float32": FLOAT, "int64": INT64, "float64": DOUBLE}
_FLOAT_ATTRIBUTE, _INT_ATTRIBUTE, _INTS_ATTRIBUTE = 1, 2, 7
_VARINT, _BYTES, _FIXED32 = 0, 2, 5


@dataclass(frozen=True)
class Graph:
    """Operations in the order of their results, constants, and shapes of the float32 inputs and
    outputs, by name.
    """

    operations: tuple[Operation, ...]
    constants: Mapping[str, npt.NDArray[Any]]
    inputs: Mapping[str, tuple[int, ...]]
    outputs: Mapping[str, tuple[int, ...]]


def written(graph: Graph, name: str, metadata: Mapping[str, str]) -> bytes:
    """Return the ONNX file of a graph."""
    used = {given for operation in graph.operations for given in operation.inputs}
    constants = {key: array for key, array in graph.constants.items() if key in used}
    body = [
        *(_part(1, _node(operation)) for operation in graph.operations),
        _part(2, name.encode()),
        *(_part(5, _tensor(key, array)) for key, array in constants.items()),
        *(_part(11, _port(key, shape)) for key, shape in graph.inputs.items()),
        *(_part(12, _port(key, shape)) for key, shape in graph.outputs.items()),
    ]
    properties = ((key.encode(), text.encode()) for key, text in metadata.items())
    return b"".join(
        [
            _whole(1, IR_VERSION),
            _part(2, b"sensor"),
            _part(7, b"".join(body)),
            _part(8, _part(1, b"") + _whole(2, OPSET)),
            *(_part(14, _part(1, key) + _part(2, text)) for key, text in properties),
        ]
    )


def _node(operation: Operation) -> bytes:
    return b"".join(
        [
            *(_part(1, name.encode()) for name in operation.inputs),
            *(_part(2, name.encode()) for name in operation.outputs),
            _part(4, operation.kind.encode()),
            *(_part(5, _attribute(name, value)) for name, value in operation.attributes.items()),
        ]
    )


def _attribute(name: str, value: Any) -> bytes:
    if isinstance(value, float):
        content, kind = _key(2, _FIXED32) + np.float32(value).tobytes(), _FLOAT_ATTRIBUTE
    elif isinstance(value, int):
        content, kind = _whole(3, value), _INT_ATTRIBUTE
    else:
        content, kind = b"".join(_whole(8, int(one)) for one in value), _INTS_ATTRIBUTE
    return _part(1, name.encode()) + content + _whole(20, kind)


def _tensor(name: str, array: npt.NDArray[Any]) -> bytes:
    little = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
    dims = b"".join(_whole(1, size) for size in array.shape)
    kind = _whole(2, _ELEMENT[array.dtype.name])
    return dims + kind + _part(8, name.encode()) + _part(9, little.tobytes())


def _port(name: str, shape: Iterable[int]) -> bytes:
    dims = b"".join(_part(1, _whole(1, size)) for size in shape)
    return _part(1, name.encode()) + _part(2, _part(1, _whole(1, FLOAT) + _part(2, dims)))


def _part(number: int, content: bytes) -> bytes:
    return _key(number, _BYTES) + _varint(len(content)) + content


def _whole(number: int, value: int) -> bytes:
    return _key(number, _VARINT) + _varint(value & (1 << 64) - 1)


def _key(number: int, wire: int) -> bytes:
    return _varint(number << 3 | wire)


def _varint(value: int) -> bytes:
    parts = bytearray()
    while value > 0x7F:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*parts, value])
