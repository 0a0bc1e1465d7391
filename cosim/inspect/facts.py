"""What an inspection brings to light: tables for people, one tree of values for programs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Table:
    """Rows of text; `hidden` rows are left out unless all are asked for."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    hidden: int = 0


@dataclass
class Facts:
    """A headline, tables, and the same as a tree of plain values."""

    headline: str
    data: dict[str, Any]
    tables: list[Table] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def pairs(self, title: str, pairs: Iterable[tuple[str, str]]) -> None:
        """Add a table of names and values, without those that are empty."""
        rows = tuple((name, value) for name, value in pairs if value)
        if rows:
            self.tables.append(Table(title, ("", ""), rows))

    def table(
        self, title: str, columns: Sequence[str], rows: Sequence[Sequence[str]], limit: int = 0
    ) -> None:
        """Add a table unless it is empty; a `limit` above 0 leaves the rest of the rows out."""
        if not rows:
            return
        shown = rows[:limit] if limit else rows
        kept = tuple(tuple(row) for row in shown)
        self.tables.append(Table(title, tuple(columns), kept, len(rows) - len(kept)))


def size_of(count: int) -> str:
    """Return a number of bytes as people read it, in powers of 1024."""
    if count < 1024:
        return f"{count} B"
    power = min(3, (count.bit_length() - 1) // 10)
    return f"{count / 1024**power:.1f} {('', 'KiB', 'MiB', 'GiB')[power]}"


def number(value: float | None, unit: str = "", digits: int = 6) -> str:
    """Return a number with its unit, '' for none."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    text = f"{value:.{digits}g}"
    return f"{text} {unit}" if unit and unit != "1" else text


def span(ends: Sequence[float], unit: str) -> str:
    """Return a range (lowest, highest) with its unit."""
    return f"{ends[0]:.4g} to {ends[1]:.4g} {unit}"
