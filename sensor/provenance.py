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
    source = commit()
    return found | ({"commit": source} if source else {})


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
