"""A note of what is under way, in a file both processes map: it survives a crash and a kill."""

from __future__ import annotations

import mmap
import struct
from pathlib import Path
from typing import Final

FILE: Final = "journal"
SIZE: Final = 2048
_HALF: Final = 1024
_HEAD: Final = struct.Struct("<QI")


class Journal:
    """Writes the number of calls made, the call under way, and the last message."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("r+b")
        self._map = mmap.mmap(self._file.fileno(), SIZE)
        self._calls = 0

    def call(self, text: str) -> None:
        """Note that a call begins."""
        self._calls += 1
        self._write(0, text)

    def message(self, text: str) -> None:
        """Note what has just been said, such as by an FMU."""
        self._write(_HALF, text)

    def _write(self, start: int, text: str) -> None:
        content = text.encode("utf-8", "replace")[: _HALF - _HEAD.size]
        _HEAD.pack_into(self._map, start, self._calls, len(content))
        at = start + _HEAD.size
        self._map[at : at + len(content)] = content


def new_journal(path: Path) -> None:
    """Make an empty journal."""
    path.write_bytes(bytes(SIZE))


def read_journal(path: Path) -> tuple[int, str, str]:
    """Return the number of calls, the call under way and the last message."""
    content = path.read_bytes()
    texts = []
    for start in (0, _HALF):
        calls, length = _HEAD.unpack_from(content, start)
        at = start + _HEAD.size
        texts.append((calls, content[at : at + min(length, _HALF)].decode("utf-8", "replace")))
    return texts[0][0], texts[0][1], texts[1][1]
