"""An ONNX file read as what it is, a protocol-buffers message: no package is needed for it.

Field numbers are those of onnx.proto (ModelProto, GraphProto, NodeProto, AttributeProto,
TensorProto).
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import prod
from typing import Any, Final

ELEMENT_TYPES: Final = (
    "undefined", "float32", "uint8", "int8", "uint16", "int16", "int32", "int64", "string", "bool",
    "float16", "float64", "uint32", "uint64", "complex64", "complex128", "bfloat16", "float8e4m3fn",
    "float8e4m3fnuz", "float8e5m2", "float8e5m2fnuz", "uint4", "int4", "float4e2m1",
)  # fmt: skip
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5


class OnnxError(Exception):
    """The bytes are no ONNX model, or cut short."""


@dataclass(frozen=True)
class Port:
    """An input or output: name, element type, and shape with names for what is open."""

    name: str
    type: str
    shape: tuple[int | str, ...]


@dataclass(frozen=True)
class Tensor:
    """Numbers as they lie in the file: element type, shape, raw bytes (little-endian), or where the
    writer chose so, a list.
    """

    name: str
    type: str
    shape: tuple[int, ...]
    raw: bytes
    numbers: tuple[float, ...]


@dataclass(frozen=True)
class Node:
    """One operator; an input or output that is left out has an empty name."""

    kind: str
    domain: str
    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    attributes: dict[str, Any]


@dataclass
class Model:
    """What an ONNX file holds."""

    ir_version: int = 0
    producer: str = ""
    producer_version: str = ""
    domain: str = ""
    version: int = 0
    description: str = ""
    graph: str = ""
    opsets: dict[str, int] = field(default_factory=dict)
    metadata: dict[str, str] = field(default_factory=dict)
    operators: Counter[str] = field(default_factory=Counter)
    inputs: list[Port] = field(default_factory=list)
    outputs: list[Port] = field(default_factory=list)
    nodes: list[Node] = field(default_factory=list)
    tensors: dict[str, Tensor] = field(default_factory=dict)
    weights: dict[str, tuple[str, tuple[int, ...]]] = field(default_factory=dict)
    external: list[str] = field(default_factory=list)

    @property
    def parameters(self) -> int:
        """Number of floating-point weights."""
        return sum(prod(shape) for kind, shape in self.weights.values() if "float" in kind)


def read_onnx(content: bytes) -> Model:
    """Return what an ONNX file holds. Raises `OnnxError`."""
    model = Model()
    try:
        for number, value in _fields(content):
            _model_field(model, number, value)
    except (
        *(IndexError, ValueError, UnicodeDecodeError, TypeError, AttributeError, OverflowError),
        struct.error,
    ) as error:
        raise OnnxError(f"it is no ONNX model, or cut short ({error})") from None
    if not model.ir_version or not (model.operators or model.outputs):
        raise OnnxError("it holds no network")
    names = set(model.weights)
    model.inputs = [port for port in model.inputs if port.name not in names]
    return model


def _fields(content: bytes) -> Iterator[tuple[int, Any]]:
    """Yield the fields of a message: a whole number, or bytes."""
    at, end = 0, len(content)
    while at < end:
        key, at = _varint(content, at)
        number, wire = key >> 3, key & 7
        if wire == _VARINT:
            value: Any
            value, at = _varint(content, at)
        elif wire == _BYTES:
            length, at = _varint(content, at)
            if at + length > end:
                raise ValueError("a part ends behind the file")
            value, at = content[at : at + length], at + length
        elif wire in (_FIXED64, _FIXED32):
            size = 8 if wire == _FIXED64 else 4
            if at + size > end:
                raise ValueError("a number ends behind the file")
            value, at = int.from_bytes(content[at : at + size], "little"), at + size
        else:
            raise ValueError(f"unknown wire type {wire}")
        if not number:
            raise ValueError("field 0")
        yield number, value


def _varint(content: bytes, at: int) -> tuple[int, int]:
    value, shift = 0, 0
    while True:
        byte = content[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
        shift += 7
        if shift > 63:
            raise ValueError("a number of more than 64 bits")


def _model_field(model: Model, number: int, value: Any) -> None:
    if number == 1:
        model.ir_version = int(value)
    elif number == 2:
        model.producer = value.decode()
    elif number == 3:
        model.producer_version = value.decode()
    elif number == 4:
        model.domain = value.decode()
    elif number == 5:
        model.version = int(value)
    elif number == 6:
        model.description = value.decode()
    elif number == 7:
        _graph(model, value)
    elif number == 8:
        parts = dict(_fields(value))
        model.opsets[parts.get(1, b"").decode()] = int(parts.get(2, 0))
    elif number == 14:
        parts = dict(_fields(value))
        model.metadata[parts.get(1, b"").decode()] = parts.get(2, b"").decode()


def _graph(model: Model, content: bytes) -> None:
    for number, value in _fields(content):
        if number == 1:
            node = _node(value)
            model.nodes.append(node)
            model.operators[f"{node.domain}.{node.kind}" if node.domain else node.kind] += 1
        elif number == 2:
            model.graph = value.decode()
        elif number == 5:
            _weight(model, value)
        elif number == 11:
            model.inputs.append(_port(value))
        elif number == 12:
            model.outputs.append(_port(value))


def _weight(model: Model, content: bytes) -> None:
    tensor = _tensor(content)
    model.tensors[tensor.name] = tensor
    model.weights[tensor.name] = (tensor.type, tensor.shape)
    if any(number == 13 for number, _ in _fields(content)):
        model.external.append(tensor.name)


def _tensor(content: bytes) -> Tensor:
    dims: list[int] = []
    numbers: list[float] = []
    name, kind, raw = "", 0, b""
    for number, value in _fields(content):
        if number == 1:
            dims += [value] if isinstance(value, int) else _packed(value)
        elif number == 2:
            kind = int(value)
        elif number in (4, 10):
            numbers += _reals(value, "f" if number == 4 else "d")
        elif number in (5, 7):
            numbers += _wholes(value)
        elif number == 8:
            name = value.decode()
        elif number == 9:
            raw = value
    return Tensor(name, _element(kind), tuple(dims), raw, tuple(numbers))


def _node(content: bytes) -> Node:
    inputs, outputs, attributes = [], [], {}
    texts = {3: "", 4: "", 7: ""}
    for number, value in _fields(content):
        if number == 1:
            inputs.append(value.decode())
        elif number == 2:
            outputs.append(value.decode())
        elif number == 5:
            name, attribute = _attribute(value)
            attributes[name] = attribute
        elif number in texts:
            texts[number] = value.decode()
    return Node(texts[4], texts[7], texts[3], tuple(inputs), tuple(outputs), attributes)


def _attribute(content: bytes) -> tuple[str, Any]:
    """Return name and value: number, text, tensor, or list of numbers or texts; of a subgraph its
    bytes.
    """
    name = ""
    found: Any = None
    lists: dict[int, list[Any]] = {7: [], 8: [], 9: []}
    for number, value in _fields(content):
        if number == 1:
            name = value.decode()
        elif number == 2:
            found = _reals(value, "f")[0]
        elif number == 3:
            found = _signed(value)
        elif number == 4:
            found = value.decode()
        elif number == 5:
            found = _tensor(value)
        elif number == 6:
            found = value
        elif number == 7:
            lists[7] += _reals(value, "f")
        elif number == 8:
            lists[8] += _wholes(value)
        elif number == 9:
            lists[9].append(value.decode())
    return name, next((tuple(values) for values in lists.values() if values), found)


def _reals(value: Any, form: str) -> list[float]:
    """Real numbers of a field: one, whose bits were read as a whole number, or packed ones."""
    size = 4 if form == "f" else 8
    content = value.to_bytes(size, "little") if isinstance(value, int) else value
    return [real for (real,) in struct.iter_unpack(f"<{form}", content)]


def _wholes(value: Any) -> list[int]:
    return [_signed(value)] if isinstance(value, int) else [_signed(v) for v in _packed(value)]


def _signed(value: int) -> int:
    return value - (1 << 64) if value >= 1 << 63 else value


def _packed(content: bytes) -> list[int]:
    at, values = 0, []
    while at < len(content):
        value, at = _varint(content, at)
        values.append(value)
    return values


def _port(content: bytes) -> Port:
    parts = dict(_fields(content))
    kind, shape = "undefined", []
    tensor = dict(_fields(parts.get(2, b""))).get(1, b"")
    for number, value in _fields(tensor):
        if number == 1:
            kind = _element(int(value))
        elif number == 2:
            for _, dimension in _fields(value):
                either = dict(_fields(dimension))
                shape.append(int(either[1]) if 1 in either else either.get(2, b"?").decode())
    return Port(parts.get(1, b"").decode(), kind, tuple(shape))


def _element(kind: int) -> str:
    return ELEMENT_TYPES[kind] if 0 <= kind < len(ELEMENT_TYPES) else f"type {kind}"
