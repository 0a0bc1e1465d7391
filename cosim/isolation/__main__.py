"""Serve work: `python -m cosim.isolation [--no-fork] MODULE...`, the modules imported beforehand.

Each line of stdin names a folder with the work in it; its process id and its exit code are the
answer. Where the system can fork, the work runs in a fork of this process, which has nothing of an
FMU in it; elsewhere the process does one work itself and ends with it.
"""

from __future__ import annotations

import ctypes
import faulthandler
import os
import pickle
import select
import signal
import sys
import traceback
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from cosim.isolation.errand import ANSWER, PRINTED, STACK, WORK, Broken
from cosim.isolation.journal import FILE, Journal


def serve(forks: bool) -> None:
    """Do the work that stdin names until it ends."""
    while line := sys.stdin.readline():
        folder = Path(line.rstrip("\n"))
        child = os.fork() if forks else 0
        if child == 0:
            if not forks:
                print(os.getpid(), flush=True)
            perform(folder)
        print(child, flush=True)
        _until_it_ends(child)
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


def _until_it_ends(child: int) -> None:
    """Wait for a child; if whoever wants its answer is gone meanwhile, end it."""
    if not hasattr(os, "pidfd_open"):
        return
    process = os.pidfd_open(child)
    try:
        # While a work is under way nothing is written to stdin: what can be read is its end.
        ready, _, _ = select.select([process, sys.stdin], [], [])
        if process not in ready:
            with suppress(ProcessLookupError):
                os.killpg(child, signal.SIGKILL)
    finally:
        os.close(process)


def perform(folder: Path) -> None:
    """Do one work, leave its answer and end the process; a crash leaves none."""
    _away_from_the_terminal(folder)
    _without_farewell()
    answer: object
    try:
        work, job = pickle.loads((folder / WORK).read_bytes())
        answer = work(job, Journal(folder / FILE))
    except Exception:
        answer = Broken(traceback.format_exc())
    sys.stdout.flush()
    sys.stderr.flush()
    (folder / ANSWER).write_bytes(pickle.dumps(answer))
    os._exit(0)  # the clean-up of an FMU's library at exit is nobody's concern


def _without_farewell() -> None:
    """Let `exit`, which an FMU may call, end the process at once: the farewell of a library waits
    for threads that a fork does not have.
    """
    if sys.platform == "linux":
        system = ctypes.CDLL(None)
        if hasattr(system, "on_exit"):  # of the GNU C library
            system.on_exit(system._exit, None)


def _away_from_the_terminal(folder: Path) -> None:
    """Keep what is printed in a file, and Python's stack in another, if it comes to that.

    The way back to the parent stays open, unused: its end is the end of the process.
    """
    os.dup(1)
    nothing = os.open(os.devnull, os.O_RDWR)
    printed = os.open(folder / PRINTED, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
    for source, target in ((nothing, 0), (printed, 1), (printed, 2)):
        os.dup2(source, target)
    if hasattr(os, "setsid"):
        with suppress(PermissionError):  # it leads one already where nothing was forked
            os.setsid()  # so that it can be killed with all that it has started
    stack = (folder / STACK).open("wb")
    faulthandler.enable(stack, all_threads=False)
    if hasattr(faulthandler, "register"):
        faulthandler.register(signal.SIGUSR1, stack, all_threads=False)


if __name__ == "__main__":
    for module in sys.argv[1:]:
        if not module.startswith("--"):
            import_module(module)
    serve(forks=hasattr(os, "fork") and "--no-fork" not in sys.argv)
