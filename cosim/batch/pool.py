"""Jobs in processes of their own, one thread each.

A scenario gives the same files as on its own, bit for bit but for the times that it took. One that
fails does not stop the others, nor does an FMU that takes its process with it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import partial

from cosim.batch import worker
from cosim.batch.job import Ended, Job

Work = Callable[[Job], Ended]
Tell = Callable[[Ended], None]
_DIED = "the process ended without a word: the FMU has taken it down"


def run_all(
    jobs: Sequence[Job], processes: int, tell: Tell = lambda ended: None
) -> tuple[list[Ended], bool]:
    """Check all jobs, then run them; return them in their order, and whether they were run.

    Where a check finds something, nothing is run and the jobs come back with their problems. `tell`
    hears of each job that has been run.
    """
    with _pool(min(processes, len(jobs))) as pool:
        checked = _through(pool, worker.check, jobs, lambda ended: None)
        if any(ended.problems for ended in checked.values()):
            return [checked[job] for job in jobs], False
        # The longest first: what is begun last should not be what all wait for.
        order = sorted(jobs, key=lambda job: -checked[job].longest_s)
        ended = _through(pool, worker.drive, order, tell)
    return [ended[job] for job in jobs], True


def _pool(processes: int) -> ProcessPoolExecutor:
    import multiprocessing

    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(processes, context, initializer=worker.start)


def _through(
    pool: ProcessPoolExecutor, work: Work, jobs: Sequence[Job], tell: Tell
) -> dict[Job, Ended]:
    """Return what `work` makes of the jobs; those whose process died are done again, each in a
    process alone, so that the one at fault is found.
    """
    ended = _tried(pool, work, jobs, tell)
    left = [job for job in jobs if job not in ended]
    with ThreadPoolExecutor(max(len(left), 1)) as threads:
        for done in threads.map(partial(_alone, work), left):
            ended[done.job] = done
            tell(done)
    return ended


def _tried(
    pool: ProcessPoolExecutor, work: Work, jobs: Sequence[Job], tell: Tell
) -> dict[Job, Ended]:
    """Return the jobs that came to an end, whatever it was; one that died may take others along."""
    ended: dict[Job, Ended] = {}
    waiting = [pool.submit(work, job) for job in jobs]
    try:
        for future in as_completed(waiting):
            with suppress(BrokenProcessPool):
                done = future.result()
                ended[done.job] = done
                tell(done)
    except KeyboardInterrupt:
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    return ended


def _alone(work: Work, job: Job) -> Ended:
    with _pool(1) as pool, suppress(BrokenProcessPool):
        return pool.submit(work, job).result()
    return Ended(job, 3, (_DIED,))
