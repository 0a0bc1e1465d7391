"""What a process does with a trial."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

from cosim.check.trials import rules, running, states
from cosim.check.trials.bench import Bench
from cosim.check.trials.job import Answer, Job
from cosim.check.trials.library import Missing, Refused
from cosim.isolation.journal import Journal

TRIALS: Final[dict[str, Callable[[Bench, Answer], None]]] = {
    "default": running.default,
    "moved": running.moved,
    "again": running.again,
    "step-size": running.step_size,
    "stop-time": running.stop_time,
    "odd-path": running.odd_path,
    "token": rules.token,
    "order": rules.order,
    "values": rules.values,
    "thread": rules.thread,
    "memory": rules.memory,
    "state": states.state,
    "serialised": states.serialised,
    "reset": states.reset,
    "instances": states.instances,
}


def perform(job: Job, journal: Journal) -> Answer:
    """Run one trial; what the FMU leaves in its working folder goes with its files."""
    os.chdir(Path(job.resources).parents[1])
    answer = Answer()
    try:
        bench = Bench(job, journal)
    except OSError as error:
        answer.add("cannot-load", job.library, f"the system cannot load it: {error}")
        answer.fatal = True
        return answer
    try:
        TRIALS[job.trial](bench, answer)
    except Refused as refusal:
        answer.add("call-failed", refusal.function, str(refusal))
    except Missing as missing:
        answer.notes.append(f"trial '{job.trial}': it needs {missing}, which is not exported")
    _categories(job, bench.library.categories, answer)
    return answer


def _categories(job: Job, found: set[str], answer: Answer) -> None:
    for category in sorted(found - set(job.categories)):
        answer.add(
            "log-category-undeclared", category or "(none)",
            f"it logs under the category '{category}', which LogCategories does not declare",
        )  # fmt: skip
