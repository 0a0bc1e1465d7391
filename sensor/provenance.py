"""Where a result comes from: commit and package versions."""

import platform
import subprocess
from importlib import metadata
from pathlib import Path

_PACKAGES = ("suspension-cosim", "numpy", "torch", "onnx", "onnxruntime")


def versions() -> dict[str, str]:
    """Return the versions of Python and the packages that matter, and the git commit where there is
    one.
    """
    found = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    commit = _commit()
    return found | ({"commit": commit} if commit else {})


def _commit() -> str:
    """Return the commit of the source tree, with `-dirty` if it was changed since; empty outside a
    git tree.
    """
    command = ["git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    try:
        done = subprocess.run(
            command, cwd=Path(__file__).parent, capture_output=True, text=True, check=False
        )
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
