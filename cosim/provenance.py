"""What made a result: versions of the packages, commit of the sources, checksums of the files."""

from __future__ import annotations

import hashlib
import platform
import subprocess
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any, Final

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
)


def provenance(files: Mapping[str, Path | None], command: str = "") -> dict[str, Any]:
    """Return the content of versions.json; `files` maps what a file is for to the file."""
    return {
        "command": command,
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "commit": commit(),
        "packages": {name: found for name in PACKAGES if (found := _version(name))},
        "files": {
            role: {"path": str(path), "sha256": sha256(path)}
            for role, path in files.items()
            if path is not None
        },
    }


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def commit() -> str | None:
    """Return the git commit of these sources, with `+` if changed; None outside a checkout."""
    here = Path(__file__).resolve()
    try:
        # An installed copy may lie inside somebody else's checkout, whose commit says nothing.
        _git(here, "ls-files", "--error-unmatch", here.name)
        changed = _git(here, "status", "--porcelain", "-uno")
        return _git(here, "rev-parse", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return None


def _git(file: Path, *arguments: str) -> str:
    done = subprocess.run(
        ["git", *arguments], cwd=file.parent, capture_output=True, text=True, check=True, timeout=10
    )
    return done.stdout.strip()


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
