"""The one exception tree of the package, and how a mistake in an input file is shown.

Every foreseeable failure is a `CosimError`; its `exit_code` is what the command line returns.
Whatever else reaches the user is a defect of this program and keeps its traceback.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar


def nearest(name: str, choices: Iterable[str]) -> str | None:
    """Return the choice most like `name` whatever its case, or None when none is close.

    A choice that `name` is the beginning of counts as nearest, the shortest first.
    """
    by_folded = {choice.casefold(): choice for choice in choices}
    wanted = name.casefold()
    longer = [folded for folded in by_folded if len(wanted) > 2 and folded.startswith(wanted)]
    if longer:
        return by_folded[min(longer, key=len)]
    matches = difflib.get_close_matches(wanted, by_folded, n=1, cutoff=0.6)
    return by_folded[matches[0]] if matches else None


def did_you_mean(name: str, choices: Iterable[str]) -> str:
    """Return `; did you mean 'x'?` for the nearest choice, or an empty text when none is close."""
    match = nearest(name, choices)
    return f"; did you mean '{match}'?" if match is not None else ""


@dataclass(frozen=True)
class Place:
    """Where something stands: a file position, or an option of the command line.

    `line` and `column` count from 1; `line` is 0 where there is no file behind the text, as for
    `--set`. `source` is the whole source line, `length` the number of columns to underline.
    """

    file: str
    line: int = 0
    column: int = 0
    source: str = ""
    length: int = 1

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file

    def excerpt(self) -> str:
        """Return the source line with carets below the spot, or an empty text without a source."""
        if not self.source:
            return ""
        # Tabs are kept in the margin so that the carets line up however wide a terminal shows them.
        before = self.source[: self.column - 1]
        margin = "".join("\t" if character == "\t" else " " for character in before)
        room = max(len(self.source.rstrip()) - len(before), 1)
        carets = "^" * max(min(self.length, room), 1)
        return f"\n{self.line:6d} | {self.source.rstrip()}\n{'':6s} | {margin}{carets}"


@dataclass(frozen=True)
class Problem:
    """One mistake in the input: a sentence, and where it stands if that is known."""

    message: str
    place: Place | None = None

    def __str__(self) -> str:
        if self.place is None:
            return self.message
        return f"{self.place}: {self.message}{self.place.excerpt()}"


class CosimError(Exception):
    """Base of every failure that a user can bring about or mend."""

    exit_code: ClassVar[int] = 2


class InputError(CosimError):
    """Wrong usage or bad input; carries every problem found, not only the first."""

    def __init__(self, problems: str | Problem | Sequence[Problem]) -> None:
        if isinstance(problems, str):
            problems = Problem(problems)
        self.problems = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __reduce__(self) -> tuple[type[InputError], tuple[tuple[Problem, ...]]]:
        """Keep the problems when the error crosses a process boundary."""
        return type(self), (self.problems,)


class FmuError(CosimError):
    """An FMU could not be loaded, refused a call, or returned an error while stepping."""

    exit_code: ClassVar[int] = 3


class NetworkError(CosimError):
    """A network could not be loaded, or failed while estimating."""

    exit_code: ClassVar[int] = 3


class BusError(CosimError):
    """A bus could not be opened or failed, or no sensor answers on it."""

    exit_code: ClassVar[int] = 3


def explained(error: CosimError | OSError) -> tuple[int, tuple[str, ...]]:
    """Return the exit code of a failure and a sentence for each of its problems."""
    if isinstance(error, CosimError):
        problems = getattr(error, "problems", (error,))
        return error.exit_code, tuple(str(problem) for problem in problems)
    where = f"'{error.filename}': " if error.filename else ""
    return InputError.exit_code, (f"{where}{error.strerror or error}",)
