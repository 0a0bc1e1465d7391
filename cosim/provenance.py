"""What made a result: versions of the packages, commit of the sources, checksums of the files."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, Final

from sensor.provenance import commit

DISTRIBUTION: Final = "suspension-cosim"
PACKAGES: Final = (
    DISTRIBUTION,
    "fmpy",
    "numpy",
    "scipy",
    "pandas",
    "onnxruntime",
    "pydantic",
    "ruamel.yaml",
    "pyarrow",
    "uplot-python",
    "python-can",
    "cantools",
)


def provenance(files: Mapping[str, Path | None], command: str = "") -> dict[str, Any]:
    """Return the content of versions.json; `files` maps what a file is for to the file."""
    return {
        "command": command,
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "commit": _commit(),
        "packages": _packages(),
        "files": {
            role: {"path": str(path), "sha256": sha256(path)}
            for role, path in files.items()
            if path is not None
        },
    }


def add_files(versions: dict[str, Any], files: Mapping[str, Path], run: str) -> None:
    """Add the files of one more run to the content of versions.json; one that another run has in
    the same role stands there once.
    """
    known = versions["files"]
    for role, path in files.items():
        name = role if known.get(role, {}).get("path", str(path)) == str(path) else f"{role} {run}"
        if name not in known:
            known[name] = {"path": str(path), "sha256": sha256(path)}


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@cache
def _commit() -> str | None:
    return commit()


@cache
def _packages() -> dict[str, str]:
    return {name: found for name in PACKAGES if (found := _version(name))}


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
