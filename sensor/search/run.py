"""The whole search: as many processes as wanted on the studies of one directory, with progress."""

import multiprocessing
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import optuna
from optuna.study import Study
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sensor.errors import SensorError
from sensor.recipe import SearchRecipe
from sensor.search.study import finished, open_storage, open_study, work
from sensor.search.trial import WindowObjective
from sensor.training_data import read_parts

STORAGE = "studies.sqlite3"


def search(recipe: SearchRecipe, data: Path, out: Path, *, jobs: int = 1) -> None:
    """Do the trials that are missing in `out`.

    Raises SensorError if recipe or data do not fit, or one of the processes failed.
    """
    out.mkdir(parents=True, exist_ok=True)
    studies = open_studies(recipe, out)
    if all(len(finished(study)) >= recipe.trials for study in studies.values()):
        return
    with _helpers(jobs - 1, recipe, data, out), _progress(recipe, studies) as say:
        _work(recipe, studies, data, say)


def open_studies(recipe: SearchRecipe, out: Path) -> dict[int, Study]:
    """Open the studies of a search, by window."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    storage = open_storage(out / STORAGE)
    return {window: open_study(storage, recipe, window) for window in recipe.windows}


def _work(
    recipe: SearchRecipe, studies: dict[int, Study], data: Path, say: Callable[[str], None]
) -> None:
    runs = read_parts(data, recipe.runs)
    objectives = {window: WindowObjective(recipe, window, runs, say) for window in recipe.windows}
    work(recipe, studies, objectives)


def _help(recipe: SearchRecipe, data: Path, out: Path) -> None:
    """Work on the same studies in a process of its own, silently."""
    _work(recipe, open_studies(recipe, out), data, lambda text: None)


@contextmanager
def _helpers(count: int, recipe: SearchRecipe, data: Path, out: Path) -> Iterator[None]:
    """Further processes for the time of a search."""
    spawn = multiprocessing.get_context("spawn")
    helpers = [spawn.Process(target=_help, args=(recipe, data, out)) for _ in range(count)]
    for helper in helpers:
        helper.start()
    try:
        yield
    except BaseException:
        for helper in helpers:
            helper.terminate()
        raise
    for helper in helpers:
        helper.join()
    failed = [str(helper.exitcode) for helper in helpers if helper.exitcode]
    if failed:
        raise SensorError(f"a process of the search ended with {', '.join(failed)}.")


@contextmanager
def _progress(recipe: SearchRecipe, studies: dict[int, Study]) -> Iterator[Callable[[str], None]]:
    """Show how many trials there are, of all processes, and a line for each of this one."""

    def done() -> int:
        return sum(len(finished(study)) for study in studies.values())

    columns = (TextColumn("trials"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("trials", total=recipe.trials * len(studies), completed=done())

        def say(text: str) -> None:
            progress.console.print(text, highlight=False)
            progress.update(task, completed=done() + 1)  # its own is finished, but not yet stored

        yield say
        progress.update(task, completed=done())
