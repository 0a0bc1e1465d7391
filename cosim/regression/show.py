"""What people read of tests on the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import click

from cosim import show
from cosim.batch.job import Ended, RunEnd
from cosim.regression.junit import verdicts_of
from cosim.tables import Table, number, verdict_of


def outcome(ended: Sequence[Ended]) -> None:
    """Say on stderr what came out of the tests."""
    show.table(table(ended))
    for one in ended:
        for words in failures(one):
            click.echo(words, err=True)
    for one in ended:
        for words in (*one.notes, *one.moved):
            click.echo(f"note: {one.job.scenario}: {words}", err=True)
    failed = sum(one.exit_code != 0 for one in ended)
    total = "1 test" if len(ended) == 1 else f"{len(ended)} tests"
    said = f"{failed} of {total} FAILED" if failed else f"{total} passed"
    click.echo(f"{said}; results in {ended[0].job.output_dir.parent}", err=True)


def failures(one: Ended) -> Iterator[str]:
    """Yield a sentence for each limit and golden of a scenario that failed, and each problem."""
    file = str(one.job.scenario)
    for run in one.runs:
        for verdict in verdicts_of(one, run.label):
            if not verdict.passed:
                yield f"{file}: {verdict}"
    for problem in one.problems:
        yield f"error: {problem if problem.startswith(file) else f'{file}: {problem}'}"


def table(ended: Sequence[Ended]) -> Table:
    """Return one row per run: its verdict, and how many of its limits and goldens hold."""
    columns = ("test", "verdict", "limits and goldens", "simulated [s]", "took [s]")
    rows = []
    for one in ended:
        file = str(one.job.scenario)
        if not one.runs:
            rows.append((file, "error", "-", "-", "-"))
        for run in one.runs:
            name = file if len(one.runs) == 1 else f"{file} ({run.label})"
            rows.append((name, verdict_of(one, run.label), *_cells(one, run)))
    return Table("Tests", columns, tuple(rows))


def _cells(one: Ended, run: RunEnd) -> tuple[str, str, str]:
    verdicts = verdicts_of(one, run.label)
    held = sum(verdict.passed for verdict in verdicts)
    simulated = run.last_s
    checks = f"{held} of {len(verdicts)}" if verdicts else "-"
    return checks, number(simulated, 1), number(run.wall_s, 1)
