"""A serialised FMU state as numbers: the doubles that the FMU's own table names."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.errors import FmuError

Array = npt.NDArray[np.float64]

TABLE = "extra/org.suspension-cosim/states.json"
_Q = "quaternion"


class StateLayout:
    """Where a serialised state holds the model's own doubles, and coordinates that are free.

    The attitude's quaternion (w x y z) has one number too many: among the coordinates stands the
    small rotation "attitude.x .y .z" [rad] about the body's axes, from the reference attitude.
    Raises `FmuError` if the FMU has no table of its state.
    """

    def __init__(self, fmu: Path) -> None:
        with zipfile.ZipFile(fmu) as archive:
            if TABLE not in archive.namelist():
                raise FmuError(f"{fmu.name}: has no {TABLE}, so its state cannot be linearised")
            table = json.loads(archive.read(TABLE))
        self.words = tuple(str(name) for name in table["doubles"])
        self._before_end = int(table["bytes_before_end"])
        self._checksum = int(table["fnv1a_checksum_at"])
        self._q = [i for i, name in enumerate(self.words) if name.split(".")[0] == _Q]
        plain = [i for i in range(len(self.words)) if i not in self._q]
        self._plain = plain
        attitude = tuple(f"attitude.{axis}" for axis in "xyz") if self._q else ()
        self.coordinates = (*(self.words[i] for i in plain), *attitude)

    def read(self, saved: bytes) -> Array:
        """Return the state's doubles, shape (words,)."""
        start = len(saved) - self._before_end
        return np.frombuffer(saved, np.float64, len(self.words), start).copy()

    def write(self, saved: bytes, words: Array) -> bytes:
        """Return the serialised state with these doubles in it."""
        start = len(saved) - self._before_end
        block = words.astype(np.float64).tobytes()
        behind = self._checksum + 8
        content = saved[behind:start] + block + saved[start + len(block) :]
        return saved[: self._checksum] + _fnv1a(content).to_bytes(8, "little") + content

    def sizes(self, words: Array) -> Array:
        """Return the coordinates' own values, an attitude's as zero, shape (coordinates,)."""
        return np.concatenate([words[self._plain], np.zeros(3 if self._q else 0)])

    def moved(self, words: Array, coordinate: int, by: float) -> Array:
        """Return the doubles with one coordinate changed."""
        result = words.copy()
        if coordinate < len(self._plain):
            result[self._plain[coordinate]] += by
            return result
        turn = np.zeros(4)
        turn[0], turn[1 + coordinate - len(self._plain)] = 1.0, 0.5 * by
        result[self._q] = _product(words[self._q], turn / np.linalg.norm(turn))
        return result

    def difference(self, words: Array, reference: Array) -> Array:
        """Return the coordinates of one state seen from another, shape (coordinates,)."""
        plain = (words - reference)[self._plain]
        if not self._q:
            return np.asarray(plain)
        inverse = reference[self._q] * np.array([1.0, -1.0, -1.0, -1.0])
        return np.concatenate([plain, 2.0 * _product(inverse, words[self._q])[1:]])


def _fnv1a(content: bytes) -> int:
    """Return the 64-bit FNV-1a checksum."""
    checksum = 14695981039346656037
    for byte in content:
        checksum = (checksum ^ byte) * 1099511628211 & 0xFFFFFFFFFFFFFFFF
    return checksum


def _product(a: Array, b: Array) -> Array:
    """Return the product of two quaternions (w x y z)."""
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.concatenate([[a[0] * b[0] - a[1:] @ b[1:]], vector])
