"""What a process of a batch does: check a scenario, or run it. Nothing heavy is imported before."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar

from cosim.batch.job import Ended, Job
from cosim.errors import CosimError, explained
from cosim.isolation import Journal

E = TypeVar("E")


def check(job: Job, journal: Journal) -> Ended:
    """Look for all that can be wrong with a scenario before its first step; build its road."""

    def look() -> Ended:
        from cosim.assembly import check as check_scenario
        from cosim.scenario.load import load_labelled

        scenario = load_labelled(job.scenario, job.overrides)
        longest = check_scenario(scenario)
        return Ended(job, longest_s=longest * len(scenario.controllers))

    journal.call("the check of the scenario")
    return guarded(look, partial(Ended, job))


def drive(job: Job, journal: Journal) -> Ended:
    """Run a scenario and write its results."""

    def run() -> Ended:
        from cosim.run import execute
        from cosim.scenario.load import load_labelled

        scenario = load_labelled(job.scenario, job.overrides)
        outcome = execute(scenario, job.output_dir, command=job.command)
        return Ended(job, outcome.exit_code, (), outcome.metrics, outcome.notes)

    journal.call("the run")
    return guarded(run, partial(Ended, job))


def guarded(work: Callable[[], E], failed: Callable[[int, tuple[str, ...]], E]) -> E:
    """Return what `work` does, or what went wrong as a result, from its exit code and sentences:
    other jobs go on.
    """
    try:
        return work()
    except (CosimError, OSError) as error:
        return failed(*explained(error))
