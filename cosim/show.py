"""What people read on the terminal; without one, the same as plain lines."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from cosim.batch import Ended
    from cosim.run import Outcome, Progress
    from cosim.tables import Table


@contextmanager
def progress() -> Iterator[Progress | None]:
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


@contextmanager
def runs(total: int) -> Iterator[Callable[[str, bool], None]]:
    """Give what is told of each run of a data set that has ended, by its name and whether it came
    to its end: a progress bar on a terminal, plain lines elsewhere.
    """
    if not total or not sys.stderr.isatty():
        width, ended = len(str(total)), 0

        def say(name: str, well: bool) -> None:
            nonlocal ended
            ended += 1
            click.echo(f"[{ended:{width}d}/{total}] {name}{'' if well else ': FAILED'}", err=True)

        yield say
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn
    from rich.progress import TimeRemainingColumn as Remaining

    columns = (BarColumn(), MofNCompleteColumn(), Remaining(), TextColumn("{task.description}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=total)

        def tell(name: str, well: bool) -> None:
            bar.update(task, advance=1, description=name)
            if not well:
                bar.console.print(f"{name}: FAILED", style="bold red", highlight=False)

        yield tell


def counter(total: int) -> Callable[[Ended], None]:
    """Return what says a line for each scenario of a batch that has ended."""
    width, ended = len(str(total)), 0

    def tell(one: Ended) -> None:
        nonlocal ended
        ended += 1
        words = {0: "passed", 1: "FAILED"}.get(one.exit_code, "error")
        click.echo(f"[{ended:{width}d}/{total}] {one.job.scenario}: {words}", err=True)

    return tell


def outcome(shown: Outcome) -> None:
    """Say on stderr what came out of one scenario."""
    from cosim.faults.shown import fault_table
    from cosim.tables import comparison_table, estimate_table, manoeuvre_table, verdict_table

    paper = shown.metrics["paper"]
    for one in shown.runs:
        figures = one.figures
        factor, simulated = figures["real_time_factor"], figures["simulated_s"]
        click.echo(
            f"{one.label}: {figures['finish_reason']}; {simulated:.2f} s simulated,"
            f" {factor:.1f} times real time",
            err=True,
        )
        if "overruns" in figures["timing"]:
            click.echo(f"{one.label}: {lateness_words(figures['timing'])}", err=True)
        if figures["bus"]:
            click.echo(f"{one.label}: {bus_words(figures['bus'])}", err=True)
    if len(shown.runs) == 1:
        only = shown.runs[0]
        table(estimate_table(only.figures, paper, shown.sensor_of(only.label)))
    else:
        table(comparison_table({one.label: one.figures for one in shown.runs}))
    for one in shown.runs:
        faults = fault_table(shown.scenario.acting_faults, one.figures, one.label)
        if faults is not None:
            table(faults)
    driven = manoeuvre_table({one.label: one.figures for one in shown.runs})
    if driven is not None:
        table(driven)
    if shown.verdicts:
        table(verdict_table(shown.verdicts))
    for note in shown.notes:
        click.echo(f"note: {note}", err=True)
    failed = sum(not verdict.passed for verdict in shown.verdicts)
    count = len(shown.verdicts)
    verdict = f"{failed} of {count} limits FAILED" if failed else f"all {count} limits hold"
    none = "no limits that count here" if shown.scenario.limits else "no limits set"
    summary = verdict if count else none
    click.echo(f"{summary}; results in {shown.output_dir}", err=True)


def lateness_words(timing: Mapping[str, Any]) -> str:
    """Return how late the samples of a run in real time were, in words."""
    p50, p99, largest = (timing[f"lateness_{part}_ms"] for part in ("p50", "p99", "max"))
    overruns = timing["overruns"]
    return (
        f"lateness median {p50:.3f} ms, 99 % {p99:.3f} ms, at most {largest:.3f} ms;"
        f" {overruns} overrun{'' if overruns == 1 else 's'}"
    )


def bus_words(figures: Mapping[str, float]) -> str:
    """Return what was measured on the bus, in words."""
    words = [f"{figures['answers_in_time']} of {figures['samples']} answers in time"]
    if "latency_p50_ms" in figures:
        p50, p99, largest = (figures[f"latency_{part}_ms"] for part in ("p50", "p99", "max"))
        words.append(f"latency median {p50:.2f} ms, 99 % {p99:.2f} ms, at most {largest:.2f} ms")
    lost = figures.get("frames_lost")
    words.append("lost frames not told" if lost is None else f"{lost} frames lost")
    return "; ".join(words)


def batch(ended: Sequence[Ended]) -> None:
    """Say on stderr what came out of several scenarios."""
    from cosim.tables import batch_table

    table(batch_table(ended))
    for note in dict.fromkeys(note for one in ended for note in one.notes):
        files = [str(one.job.scenario) for one in ended if note in one.notes]
        where = files[0] if len(files) == 1 else f"{len(files)} scenarios"
        click.echo(f"note: {where}: {note}", err=True)
    problems(ended)
    wrong = sum(one.exit_code != 0 for one in ended)
    folder = ended[0].job.output_dir.parent
    what = f"{wrong} of {len(ended)} scenarios FAILED" if wrong else f"all {len(ended)} passed"
    click.echo(f"{what}; results in {folder}", err=True)


def problems(ended: Sequence[Ended]) -> None:
    """Say on stderr what went wrong with each scenario, its file first; a wrong option once."""
    said: dict[str, None] = {}
    for one in ended:
        file = str(one.job.scenario)
        for problem in one.problems:
            named = problem.startswith((file, "--set ", "--duration ", "--real-time="))
            said[problem if named else f"{file}: {problem}"] = None
    for words in said:
        click.echo(f"error: {words}", err=True)


def table(shown: Table) -> None:
    """Show a table on stderr."""
    if not sys.stderr.isatty():
        from cosim.tables import plain

        click.echo(plain(shown), err=True)
        return
    from rich import box
    from rich.console import Console
    from rich.table import Table as RichTable
    from rich.text import Text

    rich = RichTable(title=shown.title, title_justify="left", box=box.SIMPLE_HEAD)
    rich.caption = shown.note or None
    for index, column in enumerate(shown.columns):
        rich.add_column(Text(column), justify="right" if index else "left")
    styles = {"passed": "green", "FAILED": "bold red", "error": "bold red"}
    for row in shown.rows:
        rich.add_row(*(Text(cell, style=styles.get(cell, "")) for cell in row))
    Console(stderr=True).print(rich)
