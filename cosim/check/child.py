"""Trials in processes of their own: sent out, watched call by call, and brought home or buried."""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import IO, ClassVar, Final, cast

from cosim.check.trials.job import Answer, Job, read_answer
from cosim.check.trials.journal import new_journal, read_journal
from cosim.errors import CosimError

_LOOK: Final = 0.1  # s between two looks at the journal
_START: Final = 60.0  # s that a fresh Python may take on a busy machine
_MEANINGS: Final = {
    "SIGSEGV": "SIGSEGV, memory that is not its own", "SIGABRT": "SIGABRT, it gave up",
    "SIGFPE": "SIGFPE, a wrong calculation", "SIGILL": "SIGILL, a wrong instruction",
    "SIGBUS": "SIGBUS, memory that is not there",
}  # fmt: skip


class CheckerError(CosimError):
    """A trial failed by a mistake of its own, not of the FMU's."""

    exit_code: ClassVar[int] = 3


@dataclass(frozen=True)
class Failure:
    """A trial that ended without an answer: the finding's code, and how it ended in words."""

    code: str
    words: str


class Children:
    """Runs one trial after another; a context manager, so that no process is left behind.

    `timeout` is how long one call of the FMU may take [s]; `forks` False starts a fresh Python for
    each trial, as systems without fork need.
    """

    def __init__(self, timeout: float, forks: bool = True) -> None:
        self._timeout, self._forks = timeout, forks
        self._server: subprocess.Popen[str] | None = None
        self._lines: queue.Queue[str] = queue.Queue()

    def __enter__(self) -> Children:
        return self

    def __exit__(self, *_: object) -> None:
        self._drop(kill=True)

    def run(self, job: Job) -> Answer | Failure:
        """Run a trial. Raises `CheckerError` if it did not even begin."""
        folder, journal = Path(job.answer).parent, Path(job.journal)
        Path(job.answer).unlink(missing_ok=True)
        (folder / "stderr.txt").unlink(missing_ok=True)
        new_journal(journal)
        job.write(folder / "job.json")
        code, hung = self._watch(folder / "job.json", journal)
        _, call, message = read_journal(journal)
        said = f"; its last message was: {message}" if message else ""
        if hung:
            return Failure("hang", f"{call} did not return within {self._timeout:g} s{said}")
        answer = read_answer(Path(job.answer)) if code == 0 else None
        if answer is not None:
            return answer
        if not call:
            raise CheckerError(f"trial '{job.trial}' did not begin{_last_line(folder)}")
        how = _ending(code)
        words = f"it crashed ({how})" if how else "it ended the whole process"
        words = f"{words} in {call}{said}{_last_line(folder)}"
        return Failure("crash" if how else "process-ended", words)

    # ------------------------------------------------------------ below: processes

    def _watch(self, job: Path, journal: Path) -> tuple[int, bool]:
        """Send a job; return the exit code and whether it had to be killed."""
        server = self._serving()
        with contextlib.suppress(OSError):  # it has ended; that there is no answer tells
            cast(IO[str], server.stdin).write(f"{job}\n")
            cast(IO[str], server.stdin).flush()
        trial = self._started()
        try:
            return self._until_its_end(trial, journal)
        except BaseException:
            _kill(trial)
            raise

    def _started(self) -> int:
        """Return the process id of the trial that has just been sent."""
        try:
            line = self._lines.get(timeout=_START)
        except queue.Empty:
            line = ""
        if not line:
            code = self._drop(kill=True)
            raise CheckerError(f"the process of the trials did not start (exit code {code})")
        return int(line)

    def _until_its_end(self, trial: int, journal: Path) -> tuple[int, bool]:
        """Return the exit code of a trial and whether it had to be killed."""
        calls, since = -1, time.monotonic()
        while True:
            try:
                line = self._lines.get(timeout=_LOOK)
            except queue.Empty:
                now = read_journal(journal)[0]
                if now != calls:
                    calls, since = now, time.monotonic()
                elif time.monotonic() - since > self._timeout:
                    _kill(trial)
                    self._drop(kill=False, patience=10.0)
                    return -1, True
                continue
            if line:
                return int(line), False
            code = self._drop(kill=False, patience=10.0)  # the server itself was the trial
            return code, False

    def _serving(self) -> subprocess.Popen[str]:
        if self._server is None:
            command = [sys.executable, "-m", "cosim.check.trials"]
            self._server = subprocess.Popen(
                command if self._forks else [*command, "--no-fork"], env=_environment(),
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                text=True, encoding="utf-8",
            )  # fmt: skip
            self._lines = queue.Queue()
            reader = threading.Thread(target=_read, args=(self._server, self._lines), daemon=True)
            reader.start()
        return self._server

    def _drop(self, kill: bool, patience: float = 0.0) -> int:
        """End the server; return its exit code."""
        server, self._server = self._server, None
        if server is None:
            return 0
        with contextlib.suppress(OSError):
            cast(IO[str], server.stdin).close()
        if kill:
            server.kill()
        try:
            return server.wait(patience or None)
        except subprocess.TimeoutExpired:
            server.kill()
            return server.wait()


def _read(server: subprocess.Popen[str], lines: queue.Queue[str]) -> None:
    """Pass on the server's lines; an empty one stands for its end."""
    with cast(IO[str], server.stdout) as stream:
        for line in stream:
            lines.put(line.strip())
    lines.put("")


def _kill(child: int) -> None:
    """End a trial and whatever it has started, if it still is there."""
    for end in (getattr(os, "killpg", os.kill), os.kill):
        with contextlib.suppress(ProcessLookupError):
            end(child, getattr(signal, "SIGKILL", signal.SIGTERM))
            return


def _environment() -> dict[str, str]:
    """The environment with this package on the path, wherever it was imported from."""
    root = str(Path(__file__).resolve().parents[2])
    path = os.environ.get("PYTHONPATH")
    return {**os.environ, "PYTHONPATH": root + (os.pathsep + path if path else "")}


def _ending(code: int) -> str | None:
    """Return what ended a process by force, None if it left by itself."""
    if code < 0:
        name = signal.Signals(-code).name
        return _MEANINGS.get(name, name)
    return f"{code:#x}" if code > 0xFFFF else None  # an exception code of Windows


def _last_line(folder: Path) -> str:
    spoken = folder / "stderr.txt"
    text = spoken.read_text(encoding="utf-8", errors="replace") if spoken.is_file() else ""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return f"; it printed: {lines[-1][:200]}" if lines else ""
