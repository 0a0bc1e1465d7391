"""A single run, done in a fork of the process that waits for it.

The fork keeps the terminal, what an FMU prints on it, and the signals, so it is the program as
ever. But where an FMU takes its process with it, someone is left to bring home what was recorded
and to tell how it ended. (Runs of a batch have processes of their own: `cosim.batch`.)
"""

from __future__ import annotations

import ctypes
import faulthandler
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable
from typing import IO, Any, Final

from cosim.exit_codes import INTERRUPTED
from cosim.isolation import Death, death_of

_FAILED: Final = 3
_PR_SET_PDEATHSIG: Final = 1  # of Linux' prctl
_HEEDED: Final = ("SIGCHLD", "SIGINT", "SIGTERM")
_TOLD_TO_END: Final = ("SIGHUP", "SIGINT", "SIGTERM", "SIGQUIT")


Ending = Callable[[], None]
"""To be called before a process is ended from within, so that it does not seem to have died."""


def guarded(run: Callable[[Ending], int], bury: Callable[[Death], None]) -> int:
    """Return the exit code of `run`, done in a fork of this process where one can be made; `bury`
    hears of one that did not come to its end: then the code is 3, or 130 if a signal asked for it.
    """
    if not _can_fork():
        return run(lambda: None)
    heeded = [getattr(signal, name) for name in _HEEDED]
    before = signal.pthread_sigmask(signal.SIG_BLOCK, heeded)
    with tempfile.TemporaryFile() as stack, tempfile.TemporaryFile() as end:
        sys.stdout.flush()
        sys.stderr.flush()
        child = os.fork()
        if child == 0:
            _end_with_the_parent()
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            faulthandler.enable(stack, all_threads=False)
            try:
                return run(lambda: _mark(end))
            finally:
                _mark(end)
        code = _waited(child, heeded)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if os.fstat(end.fileno()).st_size:
            return code
        stack.seek(0)
        death = death_of(code, "", "", "", stack.read().decode("utf-8", "replace"))
    told = death.signal in _TOLD_TO_END
    bury(Death("interrupted") if told else death)
    return INTERRUPTED if told else _FAILED


def _mark(end: IO[bytes]) -> None:
    end.write(b"1")
    end.flush()


def _can_fork() -> bool:
    """Whether a fork of this process is the same program for whoever looks on: no thread is lost,
    and what is written goes to the process's own output, not into a buffer such as a test's.
    """
    if not hasattr(os, "fork") or threading.active_count() > 1:
        return False
    try:
        return (sys.stdout.fileno(), sys.stderr.fileno()) == (1, 2)
    except (AttributeError, OSError, ValueError):
        return False


def _end_with_the_parent() -> None:
    """Do not go on alone where the waiting process is killed. Linux only."""
    prctl: Any = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is not None:
        prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _waited(child: int, heeded: list[signal.Signals]) -> int:
    """Return the exit code of the child, negative for a signal. What is sent to this process alone
    is passed on; what the terminal sends, the child has heard itself.
    """
    ended, status = os.waitpid(child, os.WNOHANG)
    while not ended:
        if hasattr(signal, "sigwaitinfo"):
            heard = signal.sigwaitinfo(heeded)
            number, sent_here = heard.si_signo, heard.si_code <= 0
        else:
            number, sent_here = signal.sigwait(heeded), False
        if number != signal.SIGCHLD and sent_here:
            os.kill(child, number)
        ended, status = os.waitpid(child, os.WNOHANG)
    return os.waitstatus_to_exitcode(status)
