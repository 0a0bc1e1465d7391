"""Jobs in processes of their own, one thread each, several at a time.

A scenario gives the same files as on its own, bit for bit but for the times that it took. One that
fails does not stop the others, nor does an FMU that takes its process with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from queue import SimpleQueue
from typing import Any, Final, Generic, TypeVar

from cosim.batch import worker
from cosim.batch.job import Ended, Job
from cosim.isolation import Children, Death, Journal

J = TypeVar("J")
E = TypeVar("E")
Tell = Callable[[Ended], None]
MODULES: Final = ("cosim.assembly", "cosim.compare", "cosim.report", "cosim.run", "onnxruntime")


@dataclass(frozen=True)
class Task(Generic[J, E]):
    """What a process does with a job, what is said of a job whose process died, and what changes as
    long as a job goes on, beside the calls in its journal.
    """

    work: Callable[[J, Journal], E]
    died: Callable[[J, Death], E]
    pulse: Callable[[J], Any] = lambda job: None


class Pool:
    """Processes that take jobs; a context manager. `timeout` is how long a job may stand still [s],
    None for as long as it likes.
    """

    def __init__(self, processes: int, timeout: float | None = None) -> None:
        self._stack = ExitStack()
        self._children = [Children(timeout, MODULES) for _ in range(processes)]

    def __enter__(self) -> Pool:
        for children in self._children:
            self._stack.enter_context(children)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def through(
        self, task: Task[J, E], jobs: Sequence[J], tell: Callable[[E], None] = lambda ended: None
    ) -> dict[J, E]:
        """Return what comes of the jobs, begun in their order; `tell` hears of each as it ends.

        An interrupt ends those under way, and `task.died` hears of them before it goes on.
        """
        idle: SimpleQueue[Children] = SimpleQueue()
        for children in self._children:
            idle.put(children)
        ended: dict[J, E] = {}
        with ThreadPoolExecutor(len(self._children)) as threads:
            waiting = {threads.submit(_do, task, job, idle): job for job in jobs}
            try:
                for future in as_completed(waiting):
                    ended[waiting[future]] = future.result()
                    tell(ended[waiting[future]])
            except BaseException:
                self._stop(waiting)
                raise
        return ended

    def _stop(self, waiting: dict[Future[E], J]) -> None:
        for future in waiting:
            future.cancel()
        for children in self._children:
            children.interrupt()


def _do(task: Task[J, E], job: J, idle: SimpleQueue[Children]) -> E:
    children = idle.get()
    try:
        answer = children.run(task.work, job, partial(task.pulse, job))
    finally:
        idle.put(children)
    return task.died(job, answer) if isinstance(answer, Death) else answer


def run_all(
    jobs: Sequence[Job], processes: int, tell: Tell = lambda ended: None
) -> tuple[list[Ended], bool]:
    """Check all jobs, then run them; return them in their order, and whether they were run.

    Where a check finds something, nothing is run and the jobs come back with their problems. `tell`
    hears of each job that has been run.
    """
    with Pool(min(processes, len(jobs))) as pool:
        checked = pool.through(Task(worker.check, _died), jobs)
        if any(ended.problems for ended in checked.values()):
            return [checked[job] for job in jobs], False
        # The longest first: what is begun last should not be what all wait for.
        order = sorted(jobs, key=lambda job: -checked[job].longest_s)
        ended = pool.through(Task(worker.drive, _died), order, tell)
    return [ended[job] for job in jobs], True


def _died(job: Job, death: Death) -> Ended:
    return Ended(job, 3, (sentence(death),))


def sentence(death: Death) -> str:
    """Return how the process of a run ended, in a sentence."""
    where = f" in {death.frame}" if death.frame else ""
    return f"the process of the run {death.manner}{where}{death.said}"
