"""How a process ended that brought no answer home."""

from __future__ import annotations

import re
import signal
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

_MEANINGS: Final = {
    "SIGSEGV": "SIGSEGV, memory that is not its own", "SIGABRT": "SIGABRT, it gave up",
    "SIGFPE": "SIGFPE, a wrong calculation", "SIGILL": "SIGILL, a wrong instruction",
    "SIGBUS": "SIGBUS, memory that is not there",
    "SIGKILL": "SIGKILL, ended from outside, such as for want of memory",
}  # fmt: skip
_FRAME: Final = re.compile(r'File "(?P<file>[^"]+)", line (?P<line>\d+) in (?P<function>\S+)')
_PACKAGE: Final = Path(__file__).resolve().parents[1]
_SERVER: Final = _PACKAGE / "isolation"  # below every work
_CALLER: Final = "(fmi.py, "  # the file that calls FMUs and does little else
_LONGEST: Final = 200  # characters of what a process printed last


@dataclass(frozen=True)
class Death:
    """A process that ended without an answer.

    `kind` is how, `signal` its signal's name where it has one; `call` what its journal says was
    under way, `message` and `printed` what was last said to the log and on the terminal; `stack`
    are Python's frames, the innermost first, where it could still tell.
    """

    kind: Literal["crash", "hang", "process-ended", "interrupted"]
    signal: str = ""
    call: str = ""
    message: str = ""
    printed: str = ""
    stack: str = ""
    timeout: float = 0.0

    @property
    def manner(self) -> str:
        """How it ended, in words that follow on from what it was."""
        if self.kind == "hang":
            return f"did not go on for {self.timeout:g} s"
        if self.kind == "crash":
            return f"crashed ({_MEANINGS.get(self.signal, self.signal)})"
        return "was interrupted" if self.kind == "interrupted" else "ended the whole process"

    @property
    def said(self) -> str:
        """What it said last, as the end of a sentence; nothing where it said nothing."""
        parts = (("its last message was", self.message), ("it printed", self.printed))
        return "".join(f"; {what}: {words}" for what, words in parts if words)

    @property
    def frame(self) -> str:
        """The function of this package that was under way, such as `step (fmi.py, line 133)`; of
        another one where it was none of ours, nothing where that is not known.
        """
        frames = list(_FRAME.finditer(self.stack))
        ours = [frame for frame in frames if _is_ours(Path(frame["file"]))]
        if not frames:
            return ""
        frame = (ours or frames)[0]
        return f"{frame['function']} ({Path(frame['file']).name}, line {frame['line']})"

    @property
    def where(self) -> str:
        """Where it was, to follow its manner; nothing where that is not known."""
        inside = " inside an FMU," if _CALLER in self.frame else ""
        return f"{inside} in {self.frame}" if self.frame else ""


def _is_ours(file: Path) -> bool:
    return file.is_relative_to(_PACKAGE) and not file.is_relative_to(_SERVER)


def death_of(code: int, call: str, message: str, printed: str, stack: str) -> Death:
    """Return the death of a process that ended by itself, with this exit code."""
    name = _signal(code)
    kind: Literal["crash", "process-ended"] = "crash" if name else "process-ended"
    return Death(kind, name, call, message, last_line(printed), stack)


def last_line(text: str) -> str:
    """Return the last line that is not empty, cut short."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1][:_LONGEST] if lines else ""


def _signal(code: int) -> str:
    """Return what ended a process by force, nothing if it left by itself."""
    if code < 0:
        try:
            return signal.Signals(-code).name
        except ValueError:
            return f"signal {-code}"  # of real time, which have no names
    return f"{code:#x}" if code > 0xFFFF else ""  # an exception code of Windows
