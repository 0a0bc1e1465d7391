"""Jobs in processes of their own, one thread each.

A scenario gives the same files as on its own, bit for bit but for the times that it took. One that
fails does not stop the others, nor does an FMU that takes its process with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from typing import Generic, TypeVar

from cosim.batch import worker
from cosim.batch.job import Ended, Job

J = TypeVar("J")
E = TypeVar("E")
Tell = Callable[[Ended], None]
DIED = "the process ended without a word: the FMU has taken it down"


@dataclass(frozen=True)
class Task(Generic[J, E]):
    """What a process does with a job, and what is said of a job whose process died."""

    work: Callable[[J], E]
    died: Callable[[J], E]


def run_all(
    jobs: Sequence[Job], processes: int, tell: Tell = lambda ended: None
) -> tuple[list[Ended], bool]:
    """Check all jobs, then run them; return them in their order, and whether they were run.

    Where a check finds something, nothing is run and the jobs come back with their problems. `tell`
    hears of each job that has been run.
    """

    def died(job: Job) -> Ended:
        return Ended(job, 3, (DIED,))

    with pool_of(min(processes, len(jobs))) as pool:
        checked = through(pool, Task(worker.check, died), jobs, lambda ended: None)
        if any(ended.problems for ended in checked.values()):
            return [checked[job] for job in jobs], False
        # The longest first: what is begun last should not be what all wait for.
        order = sorted(jobs, key=lambda job: -checked[job].longest_s)
        ended = through(pool, Task(worker.drive, died), order, tell)
    return [ended[job] for job in jobs], True


def pool_of(processes: int) -> ProcessPoolExecutor:
    """Return spawned processes that take jobs."""
    import multiprocessing

    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(processes, context, initializer=worker.start)


def through(
    pool: ProcessPoolExecutor, task: Task[J, E], jobs: Sequence[J], tell: Callable[[E], None]
) -> dict[J, E]:
    """Return what comes of the jobs; those whose process died are done again, each in a process
    alone, so that the one at fault is found. `tell` hears of each as it ends.
    """
    ended = _tried(pool, task, jobs, tell)
    left = [job for job in jobs if job not in ended]
    with ThreadPoolExecutor(max(len(left), 1)) as threads:
        for job, done in zip(left, threads.map(lambda job: _alone(task, job), left), strict=True):
            ended[job] = done
            tell(done)
    return ended


def _tried(
    pool: ProcessPoolExecutor, task: Task[J, E], jobs: Sequence[J], tell: Callable[[E], None]
) -> dict[J, E]:
    """Return the jobs that came to an end, whatever it was; one that died may take others along."""
    ended: dict[J, E] = {}
    waiting = {pool.submit(task.work, job): job for job in jobs}
    try:
        for future in as_completed(waiting):
            with suppress(BrokenProcessPool):
                done = future.result()
                ended[waiting[future]] = done
                tell(done)
    except KeyboardInterrupt:
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    return ended


def _alone(task: Task[J, E], job: J) -> E:
    with pool_of(1) as pool, suppress(BrokenProcessPool):
        return pool.submit(task.work, job).result()
    return task.died(job)
