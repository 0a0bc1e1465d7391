"""Values on their way through a graph: constants, and signals whose elements are followed by
number.

Exporters move elements about in many ways (transpose, slice, reshape, gather, concatenate), and say
the same with each. So nothing is compared here: an array of element numbers takes the same way, and
tells at the end which element stands where.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.errors import SensorError
from sensor.packed.graph import described
from sensor.packed.onnx_file import Node, Tensor

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Signal:
    """Elements of what `kind` says, by number: each is scale * element + offset; all three arrays
    have one shape.
    """

    kind: str
    elements: npt.NDArray[np.int64]
    scale: npt.NDArray[np.float64]
    offset: npt.NDArray[np.float64]

    @classmethod
    def of(cls, kind: str, elements: Array) -> "Signal":
        """Return these elements as they are."""
        whole = np.asarray(elements, dtype=np.int64)
        return cls(kind, whole, np.ones(whole.shape), np.zeros(whole.shape))

    @property
    def plain(self) -> bool:
        """Whether nothing has been multiplied or added."""
        return bool(np.all(self.scale == 1.0) and np.all(self.offset == 0.0))

    def moved(self, move: Callable[[Array], Array]) -> "Signal":
        """Return the signal with its elements moved about."""
        return Signal(self.kind, move(self.elements), move(self.scale), move(self.offset))


Value = Signal | Array


def affine(node: Node, a: Value, b: Value) -> Value:
    """Return the sum, difference, product or quotient of two values, of which at most one is a
    signal. Raises SensorError where that is not of the form scale * element + offset.
    """
    if isinstance(a, Signal) and isinstance(b, Signal):
        raise SensorError(f"{described(node)} of two signals is not supported there.")
    if not isinstance(a, Signal) and not isinstance(b, Signal):
        return _number(node.kind, a, b)
    if isinstance(b, Signal) and node.kind == "Div":
        raise SensorError(f"{described(node)} by a signal is not supported.")
    signal, constant = (a, b) if isinstance(a, Signal) else (b, a)
    assert isinstance(signal, Signal)
    c = np.asarray(constant, dtype=np.float64)
    if node.kind in ("Mul", "Div"):
        factor = c if node.kind == "Mul" else 1.0 / c
        scale, offset = signal.scale * factor, signal.offset * factor
    else:
        sign = -1.0 if node.kind == "Sub" and signal is b else 1.0
        added = -c if node.kind == "Sub" and signal is a else c
        scale, offset = sign * signal.scale + 0.0 * c, sign * signal.offset + added
    if scale.shape != signal.elements.shape:
        raise SensorError(f"{described(node)} repeats its input, which is not supported.")
    return Signal(signal.kind, signal.elements, scale, offset)


def rearranged(node: Node, values: Sequence[Value | None]) -> list[Value]:
    """Return the results of an operator that moves elements about. Raises SensorError naming one
    that is none.
    """
    if node.kind == "Concat":
        return [_concatenated(node, values)]
    move = _move(node, values[1:])
    value = values[0]
    assert value is not None
    if node.kind == "Split":
        return [value.moved(part) if isinstance(value, Signal) else part(value) for part in move]
    return [value.moved(move[0]) if isinstance(value, Signal) else move[0](value)]


def _number(kind: str, a: Array, b: Array) -> Array:
    functions: dict[str, Any] = {"Add": np.add, "Sub": np.subtract, "Mul": np.multiply}
    if kind in functions:
        return np.asarray(functions[kind](a, b))
    whole = np.issubdtype(np.result_type(a, b), np.integer)
    return np.asarray(np.floor_divide(a, b) if whole else np.divide(a, b))


def _concatenated(node: Node, values: Sequence[Value | None]) -> Value:
    axis = node.attributes.get("axis", 0)
    signals = [value for value in values if isinstance(value, Signal)]
    if not signals:
        return np.concatenate([np.asarray(value) for value in values], axis=axis)
    if len(signals) < len(values) or len({signal.kind for signal in signals}) > 1:
        raise SensorError(f"{described(node)} of unlike values is not supported.")
    parts = [[s.elements, s.scale, s.offset] for s in signals]
    elements, scale, offset = (np.concatenate(p, axis=axis) for p in zip(*parts, strict=True))
    return Signal(signals[0].kind, elements, scale, offset)


def _move(node: Node, given: Sequence[Value | None]) -> list[Callable[[Array], Array]]:
    """Return what the operator does to an array: one function for each result."""
    more = [None if value is None or isinstance(value, Signal) else value for value in given]
    whole = [None if value is None else [int(v) for v in np.ravel(value)] for value in more]
    first = whole[0] if whole else None
    attribute = node.attributes
    axes = first if first is not None else attribute.get("axes")
    match node.kind:
        case "Transpose":
            return [lambda x: np.transpose(x, attribute.get("perm"))]
        case "Reshape" if first is not None:
            return [lambda x: x.reshape([x.shape[i] if n == 0 else n for i, n in enumerate(first)])]
        case "Squeeze":
            return [lambda x: np.squeeze(x, None if axes is None else tuple(axes))]
        case "Unsqueeze" if axes is not None:
            return [lambda x: np.expand_dims(x, tuple(axes))]
        case "Flatten":
            axis = attribute.get("axis", 1)
            return [lambda x: x.reshape(int(np.prod(x.shape[:axis])), -1)]
        case "Gather" if more and more[0] is not None:
            return [lambda x: np.take(x, more[0], axis=attribute.get("axis", 0))]
        case "Expand" if first is not None:
            return [lambda x: np.broadcast_to(x, np.broadcast_shapes(x.shape, tuple(first)))]
        case "Slice":
            return [lambda x: x[_slices(node, whole, x.ndim)]]
        case "Split":
            return _parts(node, first)
        case _:
            return [lambda x: x]


def _slices(node: Node, whole: Sequence[list[int] | None], ndim: int) -> tuple[slice, ...]:
    """Return the index of a Slice, whose bounds are inputs, or attributes in old files."""
    given = [*whole, None, None, None, None][:4]
    starts, ends = (
        found if found is not None else list(node.attributes.get(name, ()))
        for found, name in zip(given, ("starts", "ends"), strict=False)
    )
    axes = given[2] or list(node.attributes.get("axes", range(len(starts))))
    steps = given[3] or [1] * len(starts)
    result = [slice(None)] * ndim
    for start, end, axis, step in zip(starts, ends, axes, steps, strict=True):
        stop = None if step < 0 and end < -(1 << 31) else end
        result[axis] = slice(start, stop, step)
    return tuple(result)


def _parts(node: Node, lengths: list[int] | None) -> list[Callable[[Array], Array]]:
    axis, count = node.attributes.get("axis", 0), len(node.outputs)
    given = lengths if lengths is not None else node.attributes.get("split")

    def part(i: int) -> Callable[[Array], Array]:
        def taken(x: Array) -> Array:
            size = -(-x.shape[axis] // count)
            ends = np.cumsum(given)[:-1] if given else np.arange(1, count) * size
            return np.split(x, ends, axis=axis)[i]

        return taken

    return [part(i) for i in range(count)]


def constant_of_shape(node: Node, shape: Array) -> Array:
    """Return an array of one value, zero by default."""
    from sensor.packed.tensors import array_of

    value = node.attributes.get("value")
    number = array_of(value).ravel()[0] if isinstance(value, Tensor) else np.float32(0.0)
    return np.full([int(n) for n in np.ravel(shape)], number)
