"""A record in a file that its process maps: it outlives the process, however that ends.

The file holds a head (a mark, the number of filled rows, the length of the description), the
description as JSON (step and signals by group) and the rows, time first, as they lie in memory.
"""

from __future__ import annotations

import json
import os
import struct
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError

Array = npt.NDArray[np.float64]
Counter = npt.NDArray[np.uint64]

NAME: Final = "signals.part"
_MARK: Final = b"cosimrec"
_HEAD: Final = struct.Struct("<8sQQ")
_ROWS_AT: Final = 8  # bytes before the number of rows


def map_rows(path: Path, description: dict[str, Any], shape: tuple[int, int]) -> tuple[Array, Any]:
    """Return rows (shape) and a counter (1,) of those that are filled, both in a new file.

    Raises `InputError` where there is no room for them: later that would end the process.
    """
    text = json.dumps(description).encode()
    text += b" " * (-(_HEAD.size + len(text)) % 8)
    size = _HEAD.size + len(text) + 8 * shape[0] * shape[1]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb") as stream:
            stream.write(_HEAD.pack(_MARK, 0, len(text)) + text)
            stream.flush()
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(stream.fileno(), 0, size)
            else:
                stream.truncate(size)
    except OSError as error:
        raise InputError(f"cannot write to '{path}': {error.strerror or error}") from None
    rows = np.memmap(path, np.float64, "r+", _HEAD.size + len(text), shape)
    return rows, np.memmap(path, np.uint64, "r+", _ROWS_AT, (1,))


def filled(path: Path) -> int:
    """Return how many rows of a record are filled; 0 where there is none."""
    try:
        with path.open("rb") as stream:
            head = stream.read(_HEAD.size)
    except FileNotFoundError:
        return 0
    return int(_HEAD.unpack(head)[1]) if len(head) == _HEAD.size else 0


def read_rows(path: Path) -> tuple[dict[str, Any], Array]:
    """Return the description and the filled rows, mapped.

    Raises `InputError` where the file is no record.
    """
    with path.open("rb") as stream:
        head = stream.read(_HEAD.size)
        mark, rows, length = _HEAD.unpack(head) if len(head) == _HEAD.size else (b"", 0, 0)
        if mark != _MARK:
            raise InputError(f"{path}: not the record of a run")
        description = json.loads(stream.read(length))
    columns = 1 + sum(len(signals) for _, signals in description["groups"])
    if not rows:
        return description, np.zeros((0, columns))
    return description, np.memmap(path, np.float64, "r", _HEAD.size + length, (rows, columns))
