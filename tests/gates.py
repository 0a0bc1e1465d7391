"""Gates: what is checked, against whose oracle, within which tolerance, and what was measured.

A test calls `gate`; it asserts, and enters the measurement in a ledger. `make validation` runs all
gates, the slow ones too, and writes the ledger as docs/validation/README.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

SECTIONS = (
    "Multibody equations",
    "Rest and small motions",
    "Frequency responses",
    "Tyres",
    "Dampers",
    "Roads",
    "Steady cornering",
    "Transient steering",
    "Braking and driving",
    "Kinematics and compliance",
    "Energy, symmetry, rest",
    "Solver",
    "Wheel speeds",
    "Sampling",
)

INTRODUCTION = """\
# Validation of the vehicle

Written by `make validation`; each line is an assertion of a test in `tests/test_vehicle_*.py` or
`tests/test_road_*.py`, and the command fails if one does not hold. Where a line shows several
numbers, they stand in the order FL FR RL RR, front and rear, or as its text says, and the
tolerance holds for each. Round-off figures (below 1e-10) differ from machine to machine.
One part alone: `pytest tests/test_vehicle_steering.py --validation out`.
What the model leaves out, and what that means for a reader: [left-out.md](left-out.md).
Speed: [performance.md](../performance.md).
"""


@dataclass(frozen=True)
class Limit:
    """Lowest and highest value that pass, and their wording in the table."""

    low: float
    high: float
    words: str


def at_most(value: float) -> Limit:
    """From any value up to this one."""
    return Limit(-np.inf, value, f"<= {value:g}")


def at_least(value: float) -> Limit:
    """From this value upwards."""
    return Limit(value, np.inf, f">= {value:g}")


def between(low: float, high: float) -> Limit:
    """Within both values."""
    return Limit(low, high, f"{low:g} to {high:g}")


@dataclass(frozen=True)
class Gate:
    """One line of the table."""

    section: str
    check: str
    oracle: str
    limit: Limit
    measured: tuple[float, ...]

    @property
    def passed(self) -> bool:
        """Whether every value lies within the limit."""
        return all(self.limit.low <= value <= self.limit.high for value in self.measured)

    def row(self) -> str:
        """The line in Markdown."""
        values = " ".join(f"{value:.4g}" for value in self.measured)
        verdict = "yes" if self.passed else "**NO**"
        return f"| {self.check} | {self.oracle} | {self.limit.words} | {values} | {verdict} |"


@dataclass(frozen=True)
class Plot:
    """A picture of the page: file beside it, and what it shows."""

    section: str
    file: str
    caption: str


@dataclass(frozen=True)
class Study:
    """A table of the page that reports and does not judge: text before it, header, rows."""

    section: str
    text: str
    header: tuple[str, ...]
    rows: tuple[tuple[str | float, ...], ...]

    def markdown(self) -> str:
        """Text and table."""
        lines = [[f"{c:.3g}" if isinstance(c, float) else c for c in row] for row in self.rows]
        ruled = [list(self.header), ["---"] * len(self.header), *lines]
        return f"\n{self.text}\n\n" + "".join(f"| {' | '.join(line)} |\n" for line in ruled)


LEDGER: dict[tuple[str, str], Gate] = {}
STUDIES: list[Study] = []
PLOTS: dict[str, Plot] = {}


def gate(
    section: str,
    check: str,
    oracle: str,
    measured: float | Sequence[float] | npt.NDArray[np.float64],
    limit: Limit,
) -> None:
    """Enter a measurement in the ledger and assert its limit; `check` ends with the unit."""
    assert section in SECTIONS, section
    values = tuple(float(v) for v in np.atleast_1d(np.asarray(measured, dtype=np.float64)))
    entry = Gate(section, check, oracle, limit, values)
    assert LEDGER.get((section, check), entry) == entry, f"two gates named {check}"
    LEDGER[section, check] = entry
    print(f"\ngate: {entry.row()}")
    assert entry.passed, entry.row()


def page() -> str:
    """The ledger as Markdown, sections in their order, lines in that of the tests."""
    text = INTRODUCTION
    for number, section in enumerate(SECTIONS, 1):
        gates = [g for g in LEDGER.values() if g.section == section]
        if not gates:
            continue
        text += f"\n## {number}. {section}\n\n"
        text += "| check | oracle | tolerance | measured | pass |\n|---|---|---|---|---|\n"
        text += "".join(f"{g.row()}\n" for g in gates)
        text += "".join(study.markdown() for study in STUDIES if study.section == section)
        for plot in (p for p in PLOTS.values() if p.section == section):
            name = plot.file.partition(".")[0].replace("_", " ")
            text += f"\n![{name}]({plot.file})\n\n{plot.caption}\n"
    return text


def write_page(folder: Path) -> None:
    """Write README.md."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "README.md").write_text(page(), encoding="utf-8")
