"""How commands end: failures as exit codes and sentences on stderr."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Final

import click

from cosim.errors import CosimError, explained

INTERRUPTED: Final = 130
# Libraries would start a thread per core: slower for arrays as small as these, and sums in another
# order where a batch leaves each process one core.
ONE_THREAD: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@contextmanager
def failures_as_exit_codes() -> Iterator[None]:
    """End the program with the exit code of a failure, and a sentence for each of its problems."""
    from sensor.errors import SensorError

    try:
        yield
    except BrokenPipeError:
        raise  # whoever read the output has seen enough; click ends quietly
    except (CosimError, OSError) as error:
        code, sentences = explained(error)
        for sentence in sentences:
            click.echo(f"error: {sentence}", err=True)
        sys.exit(code)
    except SensorError as error:
        for sentence in str(error).splitlines():
            click.echo(f"error: {sentence}", err=True)
        sys.exit(2)
    except KeyboardInterrupt:
        click.echo("interrupted; what was recorded until then is on disk", err=True)
        sys.exit(INTERRUPTED)


def one_thread() -> None:
    """Let libraries compute in one thread, here and in processes that are started."""
    os.environ.update(one_threaded(os.environ))


def one_threaded(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment in which libraries compute in one thread, unless it says otherwise."""
    return dict.fromkeys(ONE_THREAD, "1") | dict(environment)


def threads_that_sleep() -> None:
    """Let torch's threads sleep while they wait; to be called before torch is loaded.

    Threads that spin make training up to 20 times slower as soon as another process wants the same
    cores.
    """
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    os.environ.setdefault("GOMP_SPINCOUNT", "0")


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
