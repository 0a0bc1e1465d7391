"""The file of a run's goldens: a table like signals.csv, with the samples that are needed alone."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError
from cosim.recorder import TIME, Recorder, Signal
from cosim.regression.thinning import kept_rows

Array = npt.NDArray[np.float64]

FOLDER: Final = "golden"
_THINNED: Final = 0.1  # of the tolerance: how far a sample that is left out may lie from the line
_DIGITS: Final = 0.001  # of the tolerance: what the digits that are written may leave


def golden_path(scenario: Path, run: str) -> Path:
    """Return the file of a run's goldens, beside its scenario."""
    return scenario.parent / FOLDER / scenario.stem / f"{run}.csv"


@dataclass(frozen=True)
class Course:
    """A golden signal: its unit, and the rows (n,) and values (n,) that were kept of it."""

    unit: str
    rows: npt.NDArray[np.intp]
    values: Array

    def over(self, first: int, last: int) -> Array:
        """Return its values at each row from the first to the last, (last - first + 1,); straight
        between those that were kept, and not a number in gaps.
        """
        return np.interp(np.arange(first, last + 1), self.rows, self.values)


@dataclass(frozen=True)
class GoldenFile:
    """The goldens of a run by name, and the row at which it ended."""

    courses: Mapping[str, Course]
    last: int


@dataclass(frozen=True)
class Kept:
    """A signal to be kept: which, over which rows of the record, and the tolerance on it."""

    signal: Signal
    rows: slice
    tolerance: float


def text_of(record: Recorder, kept: Sequence[Kept]) -> str:
    """Return the content of the file of a run: of each signal the samples that straight lines need,
    with the digits that its tolerance needs.
    """
    cells: dict[int, dict[str, str]] = {record.rows - 1: {}}
    for one in kept:
        values = record.columns([one.signal.name])[one.rows, 0]
        decimals = max(0, math.ceil(-math.log10(one.tolerance * _DIGITS)))
        for row in kept_rows(values, one.tolerance * _THINNED) if len(values) else ():
            shown = f"{values[row]:.{decimals}f}"
            cells.setdefault(one.rows.start + int(row), {})[one.signal.name] = shown
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([TIME.header, *(one.signal.header for one in kept)])
    for row in sorted(cells):
        time = f"{row * record.step_s:.10g}"
        writer.writerow([time, *(cells[row].get(one.signal.name, "") for one in kept)])
    return stream.getvalue()


def read_golden(path: Path, step_s: float) -> GoldenFile | None:
    """Return the goldens of a run that has samples so many s apart; None where there is no file.

    Raises `InputError` where it is not one of these files.
    """
    try:
        lines = list(csv.reader(path.read_text("utf-8").splitlines()))
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None
    if not lines or lines[0][:1] != [TIME.header] or len(lines) < 2:
        raise InputError(f"{path}: no goldens; cosim test --accept writes them anew")
    try:
        return _parsed(lines, step_s)
    except (ValueError, IndexError):
        raise InputError(f"{path}: damaged; cosim test --accept writes it anew") from None


def _parsed(lines: list[list[str]], step_s: float) -> GoldenFile:
    rows = [round(float(line[0]) / step_s) for line in lines[1:]]
    if any(len(line) != len(lines[0]) for line in lines) or rows != sorted(set(rows)):
        raise ValueError("rows of other lengths, or not in order")
    courses = {}
    for column, header in enumerate(lines[0][1:], 1):
        name, _, unit = header.partition(" [")
        found = [(row, float(line[column])) for row, line in zip(rows, lines[1:], strict=True)
                 if line[column]]  # fmt: skip
        courses[name] = Course(
            unit.removesuffix("]"),
            np.array([row for row, _ in found], np.intp),
            np.array([value for _, value in found]),
        )
    return GoldenFile(courses, rows[-1])
