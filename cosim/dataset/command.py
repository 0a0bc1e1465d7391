"""`cosim sensor dataset`: a recipe's runs from the file to the last word on the terminal."""

from __future__ import annotations

from pathlib import Path

import click

from cosim import show
from cosim.dataset.build import Driven, build, missing
from cosim.dataset.plan import check, plan
from cosim.dataset.recipe import load_recipe


def run(recipe: Path, directory: Path, processes: int) -> int:
    """Build the data set of a recipe in `directory`; return the exit code, the highest of all runs.

    Raises `InputError` with everything wrong in the recipe before the first run is driven.
    """
    runs = plan(load_recipe(recipe))
    check(runs)
    left = missing(runs, directory)
    with show.runs(len(left)) as tell:
        ended = build(
            left, directory, processes, lambda one: tell(one.run.stem, one.exit_code == 0)
        )
    _say(ended, len(runs) - len(left), directory)
    return max((one.exit_code for one in ended), default=0)


def _say(ended: list[Driven], kept: int, directory: Path) -> None:
    for one in ended:
        for words in one.problems:
            click.echo(f"error: {one.run.stem}: {words}", err=True)
    failed = sum(one.exit_code != 0 for one in ended)
    seconds = sum(one.simulated_s for one in ended)
    parts = [f"{len(ended) - failed} runs of {seconds:.0f} s in all"]
    parts += [f"{kept} were there"] if kept else []
    parts += [f"{failed} FAILED"] if failed else []
    click.echo(f"{', '.join(parts)}; in {directory}", err=True)
