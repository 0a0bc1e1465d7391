"""What a trial is told and what it answers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Channel:
    """A variable of the FMU as the trials use it; `start` of the first element, in its type."""

    name: str
    reference: int
    type: str
    causality: str
    variability: str
    size: int
    start: Any = None
    low: float | None = None
    high: float | None = None
    nominal: float | None = None

    @property
    def is_float(self) -> bool:
        """Whether its values are floating-point numbers."""
        return self.type in ("Real", "Float64", "Float32")


@dataclass(frozen=True)
class Job:
    """One trial of one FMU. Times in s; `budget` is the wall time [s] that repeated steps may take.

    `reference` is the file with the rows of a run with moving inputs in a process of its own.
    """

    trial: str
    major: int
    library: str
    resources: str
    token: str
    channels: tuple[Channel, ...]
    categories: tuple[str, ...]
    flags: tuple[str, ...]
    start: float
    stop: float
    step: float
    internal_step: float | None
    reference: str
    logger: str = ""
    moving: bool = True
    budget: float = 2.0


@dataclass
class Answer:
    """Findings as (code, where, message); `fatal` if nothing else is worth trying."""

    findings: list[tuple[str, str, str]] = field(default_factory=list)
    fatal: bool = False
    notes: list[str] = field(default_factory=list)

    def add(self, code: str, where: str, message: str) -> None:
        """Add a finding."""
        self.findings.append((code, where, message))
