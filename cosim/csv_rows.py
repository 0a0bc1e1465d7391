"""Rows of numbers as CSV, by a library of the package's own: repr() takes ten times as long."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.errors import FmuError

_ROWS_AT_ONCE: Final = 500
_WIDEST: Final = 25  # -1.2345678901234567e-300 and a comma


def csv_lines(data: npt.NDArray[np.float64]) -> Iterator[memoryview]:
    """Yield the rows of `data` (rows, columns) as lines, some hundred at a time.

    Each number has the fewest digits that read back to the same bits, as repr() writes it; NaN is
    `nan`. A view is good until the next one is asked for.
    """
    data = np.ascontiguousarray(data, dtype=np.float64)
    rows, columns = data.shape
    buffer = ctypes.create_string_buffer(min(rows, _ROWS_AT_ONCE) * columns * _WIDEST)
    view = memoryview(buffer).cast("B")
    write = _library().csv_rows
    for first in range(0, rows, _ROWS_AT_ONCE):
        part = data[first : first + _ROWS_AT_ONCE]
        yield view[: write(part.ctypes.data, len(part), columns, buffer)]


@cache
def _library() -> Any:
    path = Path(str(resources.files("cosim") / "fmus" / "csv_rows.so"))
    if not path.is_file():
        raise FmuError(f"{path}: missing; build it with 'pip install .' or 'python fmu/build.py'")
    library = ctypes.CDLL(str(path))
    library.csv_rows.restype = ctypes.c_size_t
    library.csv_rows.argtypes = [
        ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t, ctypes.c_void_p,
    ]  # fmt: skip
    return library
