"""What a page of figures says of the machine, and what an open network takes of its memory."""

from __future__ import annotations

import platform
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_INSTANCES = 8
_PROGRAM = """
import os, sys
from pathlib import Path
from sensor.estimators import open_network
page = os.sysconf("SC_PAGE_SIZE")
used = lambda: int(Path("/proc/self/statm").read_text().split()[1]) * page
kept = [open_network(Path(sys.argv[1]))]
before = used()
kept += [open_network(Path(sys.argv[1])) for _ in range(int(sys.argv[2]))]
print((used() - before) / int(sys.argv[2]))
"""


def machine() -> str:
    """Return processor and versions in one sentence."""
    packages = ("numpy", "onnxruntime", "torch", "openvino", "fmpy")
    found = ", ".join(f"{name} {_version(name)}" for name in packages)
    return f"{_processor()}, Python {platform.python_version()}, {found}"


def memory_of(model: Path) -> float:
    """Return the resident memory [bytes] that one more open network takes in Python."""
    command = [sys.executable, "-c", _PROGRAM, str(model), str(_INSTANCES)]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def _processor() -> str:
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "is not installed"
