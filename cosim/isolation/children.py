"""The parent's side: work is sent out, watched, and its answer or its death brought home."""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, ClassVar, Final, TypeVar, cast

from cosim.errors import CosimError
from cosim.exit_codes import one_threaded
from cosim.isolation.death import Death, death_of, last_line
from cosim.isolation.errand import ANSWER, PRINTED, STACK, WORK, Broken
from cosim.isolation.journal import FILE, Journal, new_journal, read_journal

J = TypeVar("J")
E = TypeVar("E")

_LOOK: Final = 0.1  # s between two looks at the work
_START: Final = 60.0  # s that a fresh Python may take on a busy machine
_TELL: Final = 0.2  # s that a process that hangs may take to tell where
_KILLED: Final = -int(getattr(signal, "SIGKILL", signal.SIGTERM))


class WorkError(CosimError):
    """Work failed by a mistake of its own, not of what it was done with, or did not even begin."""

    exit_code: ClassVar[int] = 3


@dataclass(frozen=True)
class Watch:
    """When a work hangs: for `timeout` [s] neither a call is noted in its journal nor `pulse`
    returns something new. Without a timeout it may take as long as it likes.
    """

    timeout: float | None = None
    pulse: Callable[[], Any] = lambda: None


NO_WATCH: Final = Watch()


class Children:
    """Does one work after another, each in a process of its own; a context manager, so that no
    process is left behind.

    `modules` are imported before the first work; `forks` False starts a fresh Python for each, as
    systems without fork need.
    """

    def __init__(self, modules: Sequence[str] = (), forks: bool = True) -> None:
        self._modules, self._forks = tuple(modules), forks
        self._server: subprocess.Popen[str] | None = None
        self._lines: queue.Queue[str] = queue.Queue()
        self._folder = tempfile.TemporaryDirectory(prefix="cosim-work-", ignore_cleanup_errors=True)
        self._interrupted = threading.Event()

    def __enter__(self) -> Children:
        return self

    def __exit__(self, *_: object) -> None:
        self._drop(kill=True)
        self._folder.cleanup()

    def interrupt(self) -> None:
        """Let the work under way, and all that follows, end as interrupted; from another thread."""
        self._interrupted.set()

    def run(self, work: Callable[[J, Journal], E], job: J, watch: Watch = NO_WATCH) -> E | Death:
        """Do `work(job, journal)` in a process of its own and return what it returns, or its death.

        Raises `WorkError` if it did not begin, or raised an exception.
        """
        folder = Path(self._folder.name)
        for name in (ANSWER, PRINTED, STACK):
            (folder / name).unlink(missing_ok=True)
        new_journal(folder / FILE)
        (folder / WORK).write_bytes(pickle.dumps((work, job)))
        code, ended = self._watch(folder, watch)
        answer = _answer(folder) if code == 0 else None
        if isinstance(answer, Broken):
            raise WorkError(f"{_name(work)} is at fault:\n{answer.traceback}")
        if answer is not None:
            return cast(E, answer[0])
        _, call, message = read_journal(folder / FILE)
        printed, stack = _text(folder / PRINTED), _text(folder / STACK)
        if ended:
            if self._interrupted.is_set():
                return Death("interrupted", call=call)
            waited = watch.timeout or 0.0
            return Death("hang", "", call, message, last_line(printed), stack, waited)
        if not (call or printed or stack or code < 0):
            raise WorkError(f"{_name(work)} did not begin (exit code {code})")
        return death_of(code, call, message, printed, stack)

    # ------------------------------------------------------------ below: processes

    def _watch(self, folder: Path, watch: Watch) -> tuple[int, bool]:
        """Send a work; return the exit code and whether it had to be killed."""
        server = self._serving()
        with contextlib.suppress(OSError):  # it has ended; that there is no answer tells
            cast(IO[str], server.stdin).write(f"{folder}\n")
            cast(IO[str], server.stdin).flush()
        child = self._started()
        try:
            return self._until_its_end(child, folder / FILE, watch)
        except BaseException:
            _kill(child)
            raise

    def _started(self) -> int:
        """Return the process id of the work that has just been sent."""
        try:
            line = self._lines.get(timeout=_START)
        except queue.Empty:
            line = ""
        if not line:
            code = self._drop(kill=True)
            raise WorkError(f"the process for the work did not start (exit code {code})")
        return int(line)

    def _until_its_end(self, child: int, journal: Path, watch: Watch) -> tuple[int, bool]:
        """Return the exit code of a work and whether it had to be killed."""
        last, since = None, time.monotonic()
        while True:
            try:
                line = self._lines.get(timeout=_LOOK)
            except queue.Empty:
                now = read_journal(journal)[0], watch.pulse()
                if now != last:
                    last, since = now, time.monotonic()
                hangs = watch.timeout is not None and time.monotonic() - since > watch.timeout
                if hangs or self._interrupted.is_set():
                    if hangs:
                        _ask_where(child)
                    _kill(child)
                    self._drop(kill=False, patience=10.0)
                    return _KILLED, True
                continue
            if line:
                return int(line), False
            code = self._drop(kill=False, patience=10.0)  # the server itself did the work
            return code, False

    def _serving(self) -> subprocess.Popen[str]:
        if self._server is None:
            options = [] if self._forks else ["--no-fork"]
            self._server = subprocess.Popen(
                [sys.executable, "-m", "cosim.isolation", *options, *self._modules],
                env=_environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL, text=True, encoding="utf-8",
                start_new_session=True,  # an interrupt from the keyboard is for this process
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


def _answer(folder: Path) -> tuple[Any] | Broken | None:
    """Return what the work returned, in a tuple; None if it left no answer."""
    path = folder / ANSWER
    if not path.is_file():
        return None
    answer = pickle.loads(path.read_bytes())
    return answer if isinstance(answer, Broken) else (answer,)


def _name(work: Any) -> str:
    return str(getattr(work, "__name__", getattr(getattr(work, "func", None), "__name__", work)))


def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""


def _ask_where(child: int) -> None:
    """Let a process that hangs write down its Python stack."""
    if hasattr(signal, "SIGUSR1"):
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGUSR1)
        time.sleep(_TELL)


def _kill(child: int) -> None:
    """End a work and whatever it has started, if it still is there."""
    for end in (getattr(os, "killpg", os.kill), os.kill):
        with contextlib.suppress(ProcessLookupError):
            end(child, -_KILLED)
            return


def _environment() -> dict[str, str]:
    """The environment with this package on the path, wherever it was imported from, and libraries
    that compute in one thread.
    """
    root = str(Path(__file__).resolve().parents[2])
    path = os.environ.get("PYTHONPATH")
    return {**one_threaded(os.environ), "PYTHONPATH": root + (os.pathsep + path if path else "")}
