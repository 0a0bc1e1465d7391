"""The commands of the virtual sensor; heavy packages are imported where they are used."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from cosim.exit_codes import cores, failures_as_exit_codes, one_thread


@click.group()
def sensor() -> None:
    """Data sets, training and evaluation of the virtual sensor."""


@sensor.command()
@click.argument("recipe", type=click.Path(path_type=Path))
@click.option(
    "--out",
    metavar="DIR",
    required=True,
    type=click.Path(path_type=Path, file_okay=False),
    help="Where the Parquet files go, one per run; runs that are there already are kept.",
)
@click.option(
    "--jobs",
    metavar="N",
    type=click.IntRange(1),
    help="Drive up to N runs at the same time, as many as there are cores by default.",
)
def dataset(recipe: Path, out: Path, jobs: int | None) -> None:
    """Drive the runs of RECIPE, a YAML file, and write them as data for training.

    A run that is in DIR from the same values, scenario and vehicle FMU is not driven again. One
    that fails is named at the end; the others are written all the same.
    """
    one_thread()
    with failures_as_exit_codes():
        from cosim.dataset.command import run

        code = run(recipe, out, jobs or cores())
    sys.exit(code)


@sensor.command()
@click.option(
    "--data",
    metavar="DIR",
    required=True,
    type=click.Path(path_type=Path, file_okay=False, exists=True),
    help="Recorded runs (Parquet), as `cosim sensor dataset` writes them.",
)
@click.option(
    "--estimators",
    metavar="A,B,...",
    help="Estimators by name; all that are shipped by default.",
)
@click.option(
    "--conditions",
    metavar="A,B",
    help="Measurement conditions, ideal or production; both by default.",
)
@click.option(
    "--out",
    metavar="FILE",
    required=True,
    type=click.Path(path_type=Path, dir_okay=False),
    help="Where the figures go (JSON); those that it has of the same runs and estimators are kept.",
)
@click.option(
    "--jobs",
    metavar="N",
    type=click.IntRange(1),
    help="Evaluate up to N runs at the same time, as many as there are cores by default.",
)
def evaluate(
    data: Path, estimators: str | None, conditions: str | None, out: Path, jobs: int | None
) -> None:
    """Compare estimators with the truth of recorded runs, under every measurement condition.

    The same samples count for all estimators; the first second of a run counts for none.
    """
    one_thread()
    with failures_as_exit_codes():
        from cosim.evaluation.command import run

        run(data, _names(estimators), _names(conditions), out, jobs or cores())


def _names(text: str | None) -> list[str] | None:
    """Return the names of a list with commas; None if nothing is named."""
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]
