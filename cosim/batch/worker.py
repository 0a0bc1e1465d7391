"""What a process of a batch does: check a scenario, or run it. Nothing heavy is imported before."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from functools import partial
from types import FrameType
from typing import TypeVar

from cosim.batch.job import Ended, Job
from cosim.errors import CosimError, explained

E = TypeVar("E")
_busy = False


def start() -> None:
    """Prepare the process: an interrupt ends a run as it does in a single one, idle processes go
    without a word.
    """
    signal.signal(signal.SIGINT, _interrupted)


def check(job: Job) -> Ended:
    """Look for all that can be wrong with a scenario before its first step; build its road."""

    def look() -> Ended:
        from cosim.assembly import check as check_scenario
        from cosim.scenario.load import load_labelled

        scenario = load_labelled(job.scenario, job.overrides)
        longest = check_scenario(scenario)
        return Ended(job, longest_s=longest * len(scenario.controllers))

    return guarded(look, partial(Ended, job))


def drive(job: Job) -> Ended:
    """Run a scenario and write its results."""

    def run() -> Ended:
        from cosim.run import execute
        from cosim.scenario.load import load_labelled

        scenario = load_labelled(job.scenario, job.overrides)
        outcome = execute(scenario, job.output_dir, command=job.command)
        return Ended(job, outcome.exit_code, (), outcome.metrics, outcome.notes)

    return guarded(run, partial(Ended, job))


def guarded(work: Callable[[], E], failed: Callable[[int, tuple[str, ...]], E]) -> E:
    """Return what `work` does, or what went wrong as a result, from its exit code and sentences:
    other jobs go on.
    """
    global _busy
    _busy = True
    try:
        return work()
    except (CosimError, OSError) as error:
        return failed(*explained(error))
    finally:
        _busy = False


def _interrupted(_number: int, _frame: FrameType | None) -> None:
    if _busy:
        raise KeyboardInterrupt
    os._exit(130)
