"""What lies in the folder of a work: the work, its answer, and what it left behind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

WORK: Final = "work.pickle"
ANSWER: Final = "answer.pickle"
PRINTED: Final = "printed.txt"
STACK: Final = "stack.txt"


@dataclass(frozen=True)
class Broken:
    """The answer of a work that raised what it must not: the traceback."""

    traceback: str
