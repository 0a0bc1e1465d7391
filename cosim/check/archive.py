"""The ZIP archive of an FMU: its entries, safe extraction, and what is wrong with their names."""

from __future__ import annotations

import posixpath
import re
import stat
import zipfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from cosim.check.finding import Finding, listed
from cosim.errors import InputError

MODEL_DESCRIPTION: Final = "modelDescription.xml"
FOLDERS: Final = (
    "binaries", "documentation", "extra", "resources", "sources", "terminalsAndIcons",
)  # fmt: skip
_METHODS: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
METHOD_NAMES: Final = {
    9: "deflate64",
    12: "bzip2",
    14: "LZMA",
    93: "Zstandard",
    95: "XZ",
    98: "PPMd",
}


class Archive:
    """The readable FMU file. Raises `InputError` if there is no such file or it is no archive."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.zip = _open(path)
        self.infos = [info for info in self.zip.infolist() if not info.is_dir()]
        self.names = [info.orig_filename for info in self.infos]
        self._exact = set(self.names)
        self._folded = {name.casefold(): name for name in self.names}

    def __contains__(self, name: str) -> bool:
        return name in self._exact

    def other_case(self, name: str) -> str | None:
        """Return the entry that differs from `name` in upper and lower case alone, if any."""
        return None if name in self._exact else self._folded.get(name.casefold())

    def read(self, name: str) -> bytes:
        """Return the content of an entry."""
        return self.zip.read(self.infos[self.names.index(name)])

    def below(self, folder: str) -> list[str]:
        """Return the entries below a folder, without its name."""
        start = folder.rstrip("/") + "/"
        return [name[len(start) :] for name in self.names if name.startswith(start)]

    def extract(self, folder: Path) -> None:
        """Extract every entry that stays below `folder`."""
        for info in self.infos:
            if not _leaves(info.orig_filename) and not _is_link(info):
                self.zip.extract(info, folder)

    def close(self) -> None:
        """Close the file."""
        self.zip.close()


def _open(path: Path) -> zipfile.ZipFile:
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.is_dir():
        raise InputError(f"{path} is a folder, not an FMU; zip its content into one file")
    try:
        return zipfile.ZipFile(path)
    except zipfile.BadZipFile:
        raise InputError(f"{path}: not a ZIP archive, so no FMU, or cut short") from None
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None


def archive_findings(archive: Archive) -> Iterator[Finding]:
    """Yield what is wrong with the archive itself, whatever the model description says."""
    yield from _unsafe(archive)
    yield from _repeated(archive)
    yield from _unreadable(archive)
    yield from _spelling(archive)


def _leaves(name: str) -> bool:
    plain = name.replace("\\", "/")
    absolute = plain.startswith("/") or re.match(r"[A-Za-z]:", plain) is not None
    return absolute or posixpath.normpath(plain).split("/")[0] == ".."


def _is_link(info: zipfile.ZipInfo) -> bool:
    return stat.S_ISLNK(info.external_attr >> 16)


def _unsafe(archive: Archive) -> Iterator[Finding]:
    for info in archive.infos:
        name = info.orig_filename
        if _leaves(name):
            yield Finding(
                "unsafe-path", name,
                f"the entry '{name}' leads out of the folder that the FMU is extracted to; give "
                "it a path relative to the archive's top, without '..'",
            )  # fmt: skip
        elif "\\" in name:
            yield Finding(
                "backslash-path", name,
                f"the entry '{name}' has backslashes; ZIP archives and FMI know '/' alone, and "
                "other systems extract one file of that odd name",
            )  # fmt: skip
        if _is_link(info):
            yield Finding(
                "unsafe-path", name, f"the entry '{name}' is a symbolic link; store the file itself"
            )


def _repeated(archive: Archive) -> Iterator[Finding]:
    for name, count in Counter(archive.names).items():
        if count > 1:
            yield Finding(
                "duplicate-entry", name,
                f"the archive holds '{name}' {count} times; which one counts depends on the tool",
            )  # fmt: skip
    folded: dict[str, list[str]] = {}
    for name in dict.fromkeys(archive.names):
        folded.setdefault(name.casefold(), []).append(name)
    for names in folded.values():
        if len(names) > 1:
            yield Finding(
                "case-collision", names[0],
                f"{listed(names)} differ in upper and lower case alone: on Windows and macOS one "
                "overwrites the other; rename one",
            )  # fmt: skip


def _unreadable(archive: Archive) -> Iterator[Finding]:
    for info in archive.infos:
        if info.compress_type not in _METHODS:
            method = METHOD_NAMES.get(info.compress_type, f"method {info.compress_type}")
            yield Finding(
                "compression", info.filename,
                f"'{info.filename}' is compressed with {method}; FMI allows deflate and stored",
            )  # fmt: skip
        try:
            with archive.zip.open(info) as stream:
                while stream.read(1 << 20):
                    pass
        except (zipfile.BadZipFile, NotImplementedError, RuntimeError, OSError, EOFError) as error:
            yield Finding(
                "archive-damaged", info.filename,
                f"'{info.filename}' cannot be read: {error}; write the archive again",
            )  # fmt: skip
        except Exception as error:  # zlib.error is no subclass of any of these
            yield Finding(
                "archive-damaged", info.filename,
                f"'{info.filename}' cannot be unpacked: {error}; write the archive again",
            )  # fmt: skip


def _spelling(archive: Archive) -> Iterator[Finding]:
    tops = {name.split("/")[0] for name in archive.names if "/" in name}
    by_folded = {folder.casefold(): folder for folder in FOLDERS}
    for top in sorted(tops - set(FOLDERS)):
        right = by_folded.get(top.casefold())
        if right:
            yield Finding(
                "wrong-case", f"{top}/",
                f"the folder '{top}' must be spelt '{right}': names are case-sensitive on Linux",
            )  # fmt: skip
    if MODEL_DESCRIPTION in archive:
        return
    other = archive.other_case(MODEL_DESCRIPTION)
    nested = [name for name in archive.names if name.endswith(f"/{MODEL_DESCRIPTION}")]
    if other:
        yield Finding("wrong-case", other, f"'{other}' must be spelt '{MODEL_DESCRIPTION}'")
    elif nested:
        folder = posixpath.dirname(nested[0])
        yield Finding(
            "no-model-description", nested[0],
            f"{MODEL_DESCRIPTION} lies in the folder '{folder}'; it belongs to the archive's top: "
            "zip the content of that folder, not the folder",
        )  # fmt: skip
    else:
        yield Finding(
            "no-model-description", archive.path.name,
            f"the archive has no {MODEL_DESCRIPTION}, so it is no FMU; it holds "
            f"{listed(archive.names) or 'nothing'}",
        )  # fmt: skip
