"""`cosim compare` behind its command line."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import click

from cosim import show
from cosim.comparison.page import write_page
from cosim.comparison.read import read_runs
from cosim.comparison.table import as_json, table_of
from cosim.report import ReportError


def run(paths: Sequence[Path], output: Path, json_wanted: bool, command: str) -> None:
    """Print the table, and write the page to `output`.

    Raises `InputError` for folders without runs, and where the page cannot be written.
    """
    runs = read_runs(paths)
    table = table_of(runs)
    show.table(table)
    try:
        write_page(runs, table, command, output)
    except ReportError as missing:
        click.echo(f"note: {missing}", err=True)
    else:
        click.echo(f"page in {output}", err=True)
    if json_wanted:
        click.echo(json.dumps(as_json(runs), indent=2, ensure_ascii=False))
