"""Work for tests/test_isolation.py: what answers, dies, hangs or lies."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from cosim.isolation import Journal


def double(job: float, journal: Journal) -> dict[str, Any]:
    print("to the terminal, which it must not reach")
    return {"twice": 2 * job, "process": os.getpid(), "threads": os.environ["OMP_NUM_THREADS"]}


def nothing(job: object, journal: Journal) -> None:
    """None is an answer too."""


def abort(job: object, journal: Journal) -> None:
    journal.call("the eleventh step")
    journal.message("low on oil")
    os.write(2, b"assertion: x > 0\n\n")
    os.abort()


def segfault(job: object, journal: Journal) -> None:
    journal.call("the first step")
    ctypes.string_at(1)


def leave(code: int, journal: Journal) -> None:
    journal.call("the exit")
    os._exit(code)


def exit_in_c(code: int, journal: Journal) -> None:
    journal.call("the exit")
    ctypes.CDLL(None).exit(code)


def killed(job: object, journal: Journal) -> None:
    journal.call("the end")
    os.kill(os.getpid(), signal.SIGKILL)


def sleep_in_c(seconds: float, journal: Journal) -> None:
    journal.call("the long step")
    ctypes.CDLL(None).usleep(int(1e6 * seconds))


def goes_on(steps: int, journal: Journal) -> str:
    for k in range(steps):
        journal.call(f"step {k}")
        time.sleep(0.15)
    return "there"


def grows(file: str, journal: Journal) -> str:
    """Notes nothing in its journal, but its file grows."""
    for _ in range(8):
        with Path(file).open("a") as stream:
            stream.write("x")
        time.sleep(0.15)
    return "there"


def raises(job: object, journal: Journal) -> None:
    raise ZeroDivisionError("of its own")


def has_a_child(file: str, journal: Journal) -> None:
    """Starts a process, writes down its id, and hangs."""
    journal.call("the wait")
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    Path(file).write_text(f"{os.getpid()} {child.pid}\n")
    time.sleep(600)
