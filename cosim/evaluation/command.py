"""`cosim sensor evaluate`: from the folder of runs to the file of figures and the table."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import click

from cosim import show
from cosim.evaluation.evaluate import Content, evaluate_all
from cosim.evaluation.overview import overview
from cosim.evaluation.plan import plan


def run(
    directory: Path,
    estimators: Sequence[str] | None,
    conditions: Sequence[str] | None,
    out: Path,
    processes: int,
) -> None:
    """Evaluate the runs in `directory`, write the figures to `out`, and show all runs pooled.

    Raises `InputError` with everything wrong before the first run is evaluated.
    """
    chosen = plan(directory, estimators, conditions)
    out.parent.mkdir(parents=True, exist_ok=True)
    with show.runs(len(chosen.files)) as tell:
        evaluate_all(
            chosen,
            read_before(out),
            processes,
            lambda name: tell(name, True),
            lambda content: _write(out, content),
        )
    content = json.loads(out.read_text(encoding="utf-8"))
    show.table(overview(content))
    click.echo(f"{len(content['runs'])} runs; figures in {out}", err=True)


def _write(out: Path, content: Content) -> None:
    """Write the file, whole or not at all."""
    part = out.with_name(f".{out.name}.part")
    part.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    part.replace(out)


def read_before(path: Path) -> Content | None:
    """Return what an earlier evaluation wrote, None if there is no such file, or none to read."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return content if isinstance(content, dict) and "fingerprints" in content else None
    except (OSError, ValueError):
        return None
