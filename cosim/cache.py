"""Where what took long to make is kept: roads, and binaries for other platforms."""

from __future__ import annotations

import os
from pathlib import Path


def default_cache_dir() -> Path:
    """Return the directory named by COSIM_CACHE_DIR, or ~/.cache/suspension-cosim."""
    named = os.environ.get("COSIM_CACHE_DIR")
    return Path(named) if named else Path.home() / ".cache" / "suspension-cosim"
