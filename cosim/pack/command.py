"""The body of `cosim pack`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from cosim.inspect.facts import size_of
from cosim.pack.packing import pack


def run(model: Path, out: Path, fmi: int, platforms: Sequence[str]) -> None:
    """Pack a network and say what has been written. Raises what `pack` raises."""
    packed = pack(model, out, fmi, platforms)
    size = size_of(packed.path.stat().st_size)
    print(
        f"{packed.path}: FMI {fmi}.0, {', '.join(packed.platforms)}, {size}\n"
        f"{packed.description}\n"
        f"It differs from {model.name} by {packed.difference:.1e} m/s at most.",
        file=sys.stderr,
    )
