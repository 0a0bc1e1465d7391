"""Building a data set: the runs that are missing, in processes of their own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from cosim.batch import worker
from cosim.batch.pool import Pool, Task, sentence
from cosim.dataset.drive import drive, is_there
from cosim.dataset.plan import PlannedRun
from cosim.isolation import Journal


@dataclass(frozen=True)
class Driven:
    """How a run ended: its exit code, what went wrong in sentences, the simulated time [s]."""

    run: PlannedRun
    exit_code: int = 0
    problems: tuple[str, ...] = ()
    simulated_s: float = 0.0


def missing(runs: Sequence[PlannedRun], directory: Path) -> list[PlannedRun]:
    """Return the runs that are not in `directory`, or there from other values, another scenario or
    FMU, or torn.
    """
    return [run for run in runs if not is_there(run, directory)]


def build(
    runs: Sequence[PlannedRun],
    directory: Path,
    processes: int,
    tell: Callable[[Driven], None] = lambda driven: None,
) -> list[Driven]:
    """Drive `runs` in processes of their own and return how each ended, in their order.

    A run that fails does not stop the others; `tell` hears of each that has ended.
    """
    if not runs:
        return []
    directory.mkdir(parents=True, exist_ok=True)
    task = Task(partial(_work, directory), lambda run, death: Driven(run, 3, (sentence(death),)))
    with Pool(min(processes, len(runs))) as pool:
        ended = pool.through(task, runs, tell)
    return [ended[run] for run in runs]


def _work(directory: Path, run: PlannedRun, journal: Journal) -> Driven:
    """What a process does with a run."""
    journal.call("the run")
    return worker.guarded(
        lambda: Driven(run, simulated_s=drive(run, directory)), partial(Driven, run)
    )
