"""A batch from its first check to its last report.

Each run of a scenario has a process of its own. A scenario gives the same files as on its own, bit
for bit but for the times that it took. One that fails does not stop the others, nor does an FMU
that takes its process with it or does not come back.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

from cosim import black_box
from cosim.batch import worker
from cosim.batch.buried import buried
from cosim.batch.job import Checked, Ended, Job, Run, RunEnd
from cosim.batch.pool import Pool, Task, sentence
from cosim.isolation import Children, Death

Tell = Callable[[Ended], None]
HANGS_S: Final = 60.0
"""How long a run may stand still [s] before it counts as hanging."""


def run_all(
    jobs: Sequence[Job],
    processes: int,
    tell: Tell = lambda ended: None,
    timeout: float = HANGS_S,
    forgiven: Sequence[int] = (),
) -> tuple[list[Ended], bool]:
    """Like `run_in`, with so many processes of its own."""
    with Pool(processes) as pool:
        return run_in(pool, jobs, tell, timeout, forgiven)


def run_in(
    pool: Pool,
    jobs: Sequence[Job],
    tell: Tell = lambda ended: None,
    timeout: float = HANGS_S,
    forgiven: Sequence[int] = (),
) -> tuple[list[Ended], bool]:
    """Check all jobs, then run them; return them in their order, and whether they were run.

    Where a check finds something, nothing is run and the jobs come back with their problems, unless
    its exit code is one of those `forgiven`: then that job alone is not run. `tell` hears of each
    job as it ends, `timeout` is how long a run may stand still [s].
    """
    checked = pool.through(Task(worker.check, _unfit), jobs)
    if any(one.exit_code not in (0, *forgiven) for one in checked.values()):
        return [_ended(checked[job]) for job in jobs], False
    sound = [one for one in checked.values() if not one.problems]
    ready = pool.through(Task(worker.prepare, _unfit), [one.job for one in sound])
    left = {job: one for job, one in {**checked, **ready}.items() if one.problems}
    ended = {job: _ended(one) for job, one in left.items()}
    for one in ended.values():
        tell(one)
    batch = _Batch([one for one in sound if one.job not in left], timeout)
    ended |= batch.run(pool, tell)
    return [ended[job] for job in jobs], True


class _Batch:
    """The runs of several scenarios; the last of a scenario's brings its conclusion."""

    def __init__(self, scenarios: Sequence[Checked], timeout: float) -> None:
        self._scenarios = scenarios
        self._ends: dict[Job, dict[str, RunEnd]] = {one.job: {} for one in scenarios}
        self._lock = threading.Lock()
        self._drive = Task(worker.drive, buried, timeout, _rows, _patience)
        self._conclude = Task(worker.conclude, _unconcluded)

    def run(self, pool: Pool, tell: Tell) -> dict[Job, Ended]:
        """Run them all, the longest first: what is begun last should not be what all wait for;
        those that go by the clock one after another when nothing else goes on.
        """

        def heard(one: Ended | None) -> None:
            if one is not None:
                tell(one)

        ended: list[Ended | None] = []
        for alone, at_once in ((False, pool.processes), (True, 1)):
            chosen = [one for one in self._scenarios if one.alone == alone]
            runs = [Run(one, i) for one in chosen for i in range(len(one.labels))]
            runs.sort(key=lambda run: -run.checked.longest_s)
            ended += pool.each(self._one, runs, heard, at_once).values()
        return {one.job: one for one in ended if one is not None}

    def _one(self, children: Children, run: Run) -> Ended | None:
        """Do one run; return the end of its scenario if it was the last of it."""
        begin, checked = time.monotonic(), run.checked
        end = self._drive.done(children, run)
        end = replace(end, wall_s=time.monotonic() - begin)
        with self._lock:
            ends = self._ends[checked.job]
            ends[run.label] = end
            if len(ends) < len(checked.labels):
                return None
        in_order = tuple(ends[label] for label in checked.labels)
        return self._conclude.done(children, worker.Conclusion(checked.job, in_order))


def _ended(checked: Checked) -> Ended:
    return Ended(checked.job, checked.exit_code, checked.problems)


def _rows(run: Run) -> int:
    return black_box.filled(run.folder / black_box.NAME)


def _patience(run: Run) -> float:
    return run.checked.connect_s


def _unfit(job: Job, death: Death) -> Checked:
    return Checked(job, 3, (sentence(death),))


def _unconcluded(conclusion: worker.Conclusion, death: Death) -> Ended:
    problems = [words for run in conclusion.runs for words in run.problems]
    return Ended(conclusion.job, 3, (*problems, sentence(death)), runs=conclusion.runs)
