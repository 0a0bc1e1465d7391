"""Zip archives with fixed time stamps: the same contents give the same bytes."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Mapping
from io import BytesIO
from pathlib import Path
from typing import Final

_TIME: Final = (1980, 1, 1, 0, 0, 0)


def zipped(contents: Mapping[str, bytes]) -> bytes:
    """Return an archive of `contents`; FMUs in it, archives themselves, are stored as they are."""
    return _written((_entry(name), content) for name, content in contents.items())


def fmu_with(fmu: Path, name: str, content: bytes) -> bytes:
    """Return the FMU with one more file in it, or another one of that name; the rest as it is."""
    with zipfile.ZipFile(fmu) as archive:
        kept = [(e, archive.read(e)) for e in archive.infolist() if e.filename != name]
    return _written([*kept, (_entry(name), content)])


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _TIME)
    archive = name.endswith(".fmu")
    entry.compress_type = zipfile.ZIP_STORED if archive else zipfile.ZIP_DEFLATED
    entry.create_system = 3  # Unix, wherever this runs
    entry.external_attr = 0o644 << 16
    return entry


def _written(entries: Iterable[tuple[zipfile.ZipInfo, bytes]]) -> bytes:
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for entry, content in entries:
            archive.writestr(entry, content)
    return buffer.getvalue()
