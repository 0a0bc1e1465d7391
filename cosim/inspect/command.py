"""The body of `cosim inspect`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from cosim.inspect.facts import Facts
from cosim.inspect.kind import recognise
from cosim.inspect.show import show
from cosim.results import finite

ROWS = 20  # of a list of variables, unless all are asked for


def run(path: Path, as_json: bool, every: bool) -> None:
    """Print what is inside a file. Raises `CosimError` if it is none of the kinds, or damaged."""
    facts = inspect(path, 0 if every else ROWS)
    if as_json:
        print(json.dumps(finite(facts.data), indent=2, ensure_ascii=False, allow_nan=False))
    else:
        show(facts, sys.stdout)


def inspect(path: Path, limit: int = 0) -> Facts:
    """Return what is inside a file; long lists end after `limit` rows if it is above 0."""
    kind = recognise(path)
    if kind == "fmu":
        from cosim.inspect.fmu import inspect as inspect_fmu

        return inspect_fmu(path, limit)
    if kind == "network":
        from cosim.inspect.network import inspect as inspect_network

        return inspect_network(path)
    if kind == "road":
        from cosim.inspect.road import inspect as inspect_road

        return inspect_road(path)
    from cosim.inspect.scenario import inspect as inspect_scenario

    return inspect_scenario(path)
