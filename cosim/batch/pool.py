"""Jobs in processes of their own, one thread each, several at a time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from queue import SimpleQueue
from typing import Any, Final, Generic, TypeVar

from cosim.isolation import Children, Death, Journal, Watch

J = TypeVar("J")
E = TypeVar("E")
# Imported once, before the forks: else each of a scenario's four would import them anew.
MODULES: Final = (
    "cosim.assembly", "cosim.batch.conclusion", "cosim.compare", "cosim.control.against_truth",
    "cosim.control.figures", "cosim.report", "cosim.run", "cosim.scenario.load", "fmpy", "jinja2",
    "lxml.etree", "onnxruntime", "sensor.carried.runtime", "sensor.runtime",
)  # fmt: skip


@dataclass(frozen=True)
class Task(Generic[J, E]):
    """What a process does with a job, what is said of a job whose process died, how long a job may
    stand still [s], what changes as long as it goes on, beside the calls in its journal, and how
    much longer one may wait for others [s].
    """

    work: Callable[[J, Journal], E]
    died: Callable[[J, Death], E]
    timeout: float | None = None
    pulse: Callable[[J], Any] = lambda job: None
    patience: Callable[[J], float] = lambda job: 0.0

    def done(self, children: Children, job: J) -> E:
        """Return what comes of a job."""
        timeout = None if self.timeout is None else self.timeout + self.patience(job)
        answer = children.run(self.work, job, Watch(timeout, partial(self.pulse, job)))
        return self.died(job, answer) if isinstance(answer, Death) else answer


class Pool:
    """Processes that take jobs, started when they are needed; a context manager."""

    def __init__(self, processes: int) -> None:
        self._stack = ExitStack()
        self._children = [self._stack.enter_context(Children(MODULES)) for _ in range(processes)]

    @property
    def processes(self) -> int:
        """How many there are at most."""
        return len(self._children)

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the processes."""
        self._stack.close()

    def through(
        self, task: Task[J, E], jobs: Sequence[J], tell: Callable[[E], None] = lambda ended: None
    ) -> dict[J, E]:
        """Return what comes of the jobs, begun in their order; `tell` hears of each as it ends."""
        return self.each(task.done, jobs, tell, len(self._children))

    def each(
        self,
        work: Callable[[Children, J], E],
        jobs: Sequence[J],
        tell: Callable[[E], None],
        at_once: int,
    ) -> dict[J, E]:
        """Return what `work`, in a thread here with processes to use, makes of each of the jobs, so
        many at once.

        An interrupt ends the processes under way, and their deaths are heard of before it goes on.
        """
        idle: SimpleQueue[Children] = SimpleQueue()
        for children in self._children[:at_once]:
            idle.put(children)
        ended: dict[J, E] = {}
        with ThreadPoolExecutor(at_once) as threads:
            waiting = {threads.submit(_with_idle, work, job, idle): job for job in jobs}
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


def _with_idle(work: Callable[[Children, J], E], job: J, idle: SimpleQueue[Children]) -> E:
    children = idle.get()
    try:
        return work(children, job)
    finally:
        idle.put(children)


def sentence(death: Death) -> str:
    """Return how the process of a run ended, in a sentence."""
    return f"the process of the run {death.manner}{death.where}{death.said}"
