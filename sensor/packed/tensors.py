"""Tensors of an ONNX file as arrays."""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sensor.errors import SensorError
from sensor.packed.onnx_file import Tensor

_TYPES: Final = {
    "float32": np.float32,
    "float64": np.float64,
    "int32": np.int32,
    "int64": np.int64,
    "bool": np.bool_,
}


def array_of(tensor: Tensor) -> npt.NDArray[Any]:
    """Return a tensor's numbers. Raises SensorError if their type is none that a sensor's network
    has, or numbers are missing.
    """
    kind = _TYPES.get(tensor.type)
    if kind is None:
        raise SensorError(
            f"constant {tensor.name!r} is of type {tensor.type}, where float32, float64, int32,"
            " int64 or bool belongs."
        )
    if tensor.numbers:
        flat: npt.NDArray[Any] = np.array(tensor.numbers, dtype=kind)
    elif len(tensor.raw) % np.dtype(kind).itemsize:
        raise SensorError(f"constant {tensor.name!r} ends within a number.")
    else:
        flat = np.frombuffer(tensor.raw, dtype=np.dtype(kind).newbyteorder("<")).astype(kind)
    if flat.size != np.prod(tensor.shape, dtype=np.int64):
        raise SensorError(
            f"constant {tensor.name!r} has {flat.size} numbers, where its shape"
            f" {list(tensor.shape)} has another number of them."
        )
    return flat.reshape(tensor.shape)
