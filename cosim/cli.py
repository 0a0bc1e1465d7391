"""The command line; heavy packages are imported where they are used, so that `--help` is quick.

Results for programs go to stdout (`--json`), words for people to stderr. Exit codes: 0 fine, 1 a
limit failed, 2 wrong usage or bad input, 3 an FMU or a network failed, 130 interrupted.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cosim.errors import CosimError

if TYPE_CHECKING:
    from cosim.run import Outcome, Progress
    from cosim.tables import Table

INTERRUPTED = 130


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="suspension-cosim", prog_name="cosim")
def main() -> None:
    """Drive a vehicle FMU over a road and compare a virtual suspension sensor with the truth."""


@main.command()
@click.argument("scenario")
@click.option("--json", "as_json", is_flag=True, help="Print the metrics as JSON on stdout.")
@click.option("--duration", metavar="S", help="Simulate S seconds, whatever the scenario says.")
@click.option(
    "--output-dir",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="Where the results go; results/SCENARIO by default.",
)
@click.option(
    "--set",
    "overrides",
    metavar="KEY=VALUE",
    multiple=True,
    help="Override a field of the scenario; may be repeated.",
)
def run(
    scenario: str,
    as_json: bool,
    duration: str | None,
    output_dir: Path | None,
    overrides: tuple[str, ...],
) -> None:
    """Run SCENARIO, a YAML file, and write its results.

    Fields are overridden by their dotted path, items of a list by their number from 0:
    --set driver.style=normal, --set controllers.0.kind=passive.
    """
    with _failures_as_exit_codes():
        from cosim.scenario.load import load_labelled

        labelled = [(text, f"--set {text}") for text in overrides]
        if duration is not None:
            labelled.append((f"duration={duration}", f"--duration {duration}"))
        settings = load_labelled(scenario, labelled)
        target = output_dir or Path("results") / Path(scenario).stem

        from cosim.run import execute

        command = "cosim " + shlex.join(sys.argv[1:])
        with _progress() as progress:
            outcome = execute(settings, target, progress, command=command)
        _show(outcome)
        if as_json:
            import json

            click.echo(json.dumps(outcome.metrics, indent=2, ensure_ascii=False))
    sys.exit(outcome.exit_code)


@main.command()
@click.argument("recipe", type=click.Path(path_type=Path))
@click.option(
    "--out",
    metavar="DIR",
    required=True,
    type=click.Path(path_type=Path),
    help="Where the Parquet files go, one per run; runs that are there already are kept.",
)
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1), help="Processes.")
def dataset(recipe: Path, out: Path, workers: int) -> None:
    """Drive the runs of RECIPE, a YAML file, and write them as data for training."""
    with _failures_as_exit_codes():
        from cosim.dataset import drive_all

        count = drive_all(recipe, out, workers, lambda stem: click.echo(stem, err=True))
        click.echo(f"{count} runs in {out}", err=True)


@main.command()
@click.argument("fmus", metavar="FMU...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print the reports as JSON on stdout.")
@click.option("--static", is_flag=True, help="Only read the FMU; do not run it.")
@click.option(
    "--timeout",
    metavar="S",
    default=20.0,
    show_default=True,
    type=click.FloatRange(min=0, min_open=True),
    help="Wall time in s that one call of an FMU may take.",
)
def check(fmus: tuple[Path, ...], as_json: bool, static: bool, timeout: float) -> None:
    """Find the defects of co-simulation FMUs, FMI 2.0 or 3.0, in their files and while they run.

    Each FMU runs in processes of its own, so that a crash or a hang becomes a finding.
    """
    with _failures_as_exit_codes():
        from cosim.check.command import run as run_checks

        code = run_checks(fmus, as_json, static, timeout)
    sys.exit(code)


@contextmanager
def _failures_as_exit_codes() -> Iterator[None]:
    try:
        yield
    except CosimError as error:
        for problem in getattr(error, "problems", (error,)):
            click.echo(f"error: {problem}", err=True)
        sys.exit(error.exit_code)
    except OSError as error:
        where = f"'{error.filename}': " if error.filename else ""
        click.echo(f"error: {where}{error.strerror or error}", err=True)
        sys.exit(2)
    except KeyboardInterrupt:
        click.echo("interrupted; what was recorded until then is on disk", err=True)
        sys.exit(INTERRUPTED)


@contextmanager
def _progress() -> Iterator[Progress | None]:
    """Give a progress bar per run on a terminal, nothing elsewhere."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
    )
    tasks: dict[str, TaskID] = {}
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:

        def tell(label: str, done: int, total: int) -> None:
            if label not in tasks:
                tasks[label] = bar.add_task(label)
            bar.update(tasks[label], completed=done, total=total)

        yield tell


def _show(outcome: Outcome) -> None:
    """Say on stderr what came out."""
    from cosim.tables import comparison_table, estimate_table, verdict_table

    show = _show_rich if sys.stderr.isatty() else _show_plain
    paper = outcome.metrics["paper"]
    for one in outcome.runs:
        figures = one.figures
        factor, simulated = figures["real_time_factor"], figures["simulated_s"]
        click.echo(
            f"{one.label}: {figures['finish_reason']}; {simulated:.2f} s simulated,"
            f" {factor:.1f} times real time",
            err=True,
        )
    if len(outcome.runs) == 1:
        show(estimate_table(outcome.runs[0].figures, paper))
    else:
        show(comparison_table({one.label: one.figures for one in outcome.runs}))
    if outcome.verdicts:
        show(verdict_table(outcome.verdicts))
    for note in outcome.notes:
        click.echo(f"note: {note}", err=True)
    failed = sum(not verdict.passed for verdict in outcome.verdicts)
    count = len(outcome.verdicts)
    verdict = f"{failed} of {count} limits FAILED" if failed else f"all {count} limits hold"
    none = "no limits for this surface" if outcome.scenario.limits else "no limits set"
    summary = verdict if count else none
    click.echo(f"{summary}; results in {outcome.output_dir}", err=True)


def _show_plain(table: Table) -> None:
    from cosim.tables import plain

    click.echo(plain(table), err=True)


def _show_rich(table: Table) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table as RichTable
    from rich.text import Text

    shown = RichTable(title=table.title, title_justify="left", box=box.SIMPLE_HEAD)
    shown.caption = table.note or None
    for index, column in enumerate(table.columns):
        shown.add_column(Text(column), justify="right" if index else "left")
    styles: dict[str, str] = {"passed": "green", "FAILED": "bold red"}
    for row in table.rows:
        shown.add_row(*(Text(cell, style=styles.get(cell, "")) for cell in row))
    Console(stderr=True).print(shown)
