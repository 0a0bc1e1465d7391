"""Serve trials: each line of stdin names a job; its process id and its exit code are the answer.

Where the system can fork, each trial runs in a fork of this small process, which has nothing of the
FMU in it; elsewhere the process runs one trial itself and ends with it.
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Final

from cosim.check.trials import rules, running, states
from cosim.check.trials.bench import Bench
from cosim.check.trials.job import Answer, Job, read_job
from cosim.check.trials.library import Missing, Refused

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


def serve(forks: bool) -> None:
    """Run the jobs that stdin names until it ends."""
    while line := sys.stdin.readline():
        path = Path(line.rstrip("\n"))
        child = os.fork() if forks else 0
        if child == 0:
            if not forks:
                print(os.getpid(), flush=True)
            perform(path)
        print(child, flush=True)
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


def perform(path: Path) -> None:
    """Run one trial, write its answer and end the process; a crash writes none."""
    _away_from_the_terminal(path.parent)
    job = read_job(path)
    answer = Answer()
    try:
        bench = Bench(job)
    except OSError as error:
        answer.add("cannot-load", job.library, f"the system cannot load it: {error}")
        answer.fatal = True
    else:
        _run(bench, job, answer)
        _categories(job, bench.library.categories, answer)
    answer.write(Path(job.answer))
    os._exit(0)  # the library's own clean-up at exit is not on trial


def _away_from_the_terminal(folder: Path) -> None:
    """Nothing that an FMU prints gets into the report; its errors are kept.

    The way back to the parent stays open, unused: its end is the end of the process.
    """
    os.chdir(folder)
    os.dup(1)
    nothing = os.open(os.devnull, os.O_RDWR)
    errors = os.open(folder / "stderr.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    for source, target in ((nothing, 0), (nothing, 1), (errors, 2)):
        os.dup2(source, target)
    if hasattr(os, "setsid"):
        os.setsid()


def _run(bench: Bench, job: Job, answer: Answer) -> None:
    try:
        TRIALS[job.trial](bench, answer)
    except Refused as refusal:
        answer.add("call-failed", refusal.function, str(refusal))
    except Missing as missing:
        answer.notes.append(f"trial '{job.trial}': it needs {missing}, which is not exported")
    except Exception:
        answer.broken = traceback.format_exc()


def _categories(job: Job, found: set[str], answer: Answer) -> None:
    for category in sorted(found - set(job.categories)):
        answer.add(
            "log-category-undeclared", category or "(none)",
            f"it logs under the category '{category}', which LogCategories does not declare",
        )  # fmt: skip


if __name__ == "__main__":
    serve(forks=hasattr(os, "fork") and "--no-fork" not in sys.argv)
