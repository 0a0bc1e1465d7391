"""The record of a run: one row per sample, every value in one array made beforehand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
import numpy.typing as npt

from cosim.black_box import map_rows, read_rows
from cosim.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

Array = npt.NDArray[np.float64]
Format = Literal["csv", "parquet"]

SAMPLE_STEP_S: Final = 0.01  # 100 Hz


@dataclass(frozen=True)
class Signal:
    """One column: its name, its unit (SI; empty for none) and what it is."""

    name: str
    unit: str
    description: str = ""

    @property
    def header(self) -> str:
        """Name and unit as they head a column: `Car.ax [m/s2]`."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


TIME: Final = Signal("time", "s", "time, an integer times the sample step")


class Recorder:
    """Keeps what every block said at t_k = k h, k = 0 included.

    `groups` names the columns of each part that `append` is given, in that order. The array is
    (rows, 1 + signals), time first; rows that were not reached are never shown or written.
    """

    def __init__(
        self,
        groups: Sequence[tuple[str, Sequence[Signal]]],
        rows: int,
        step_s: float = SAMPLE_STEP_S,
    ) -> None:
        self.signals = (TIME, *(signal for _, signals in groups for signal in signals))
        names = [signal.name for signal in self.signals]
        doubled = {name for name in names if names.count(name) > 1}
        if doubled:
            raise ValueError(f"signals recorded twice: {', '.join(sorted(doubled))}")
        self.step_s = step_s
        self._rows = 0
        self._filled = np.zeros(1, np.uint64)  # the same for whoever else maps the rows
        self._data = np.full((rows, len(names)), np.nan)
        self._slices: dict[str, slice] = {}
        start = 1
        for name, signals in groups:
            self._slices[name] = slice(start, start + len(signals))
            start += len(signals)
        self._columns = tuple(self._slices.values())

    @property
    def rows(self) -> int:
        """Number of rows filled so far."""
        return self._rows

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the groups, in the order that `append` takes them."""
        return tuple(self._slices)

    @property
    def time(self) -> Array:
        """Time of each row, (rows,) [s]."""
        return self._data[: self._rows, 0]

    def append(self, k: int, *parts: npt.ArrayLike) -> None:
        """Copy one part per group into row `k`, which must be the next one."""
        if k != self._rows:
            raise ValueError(f"row {k} recorded after {self._rows} rows")
        if len(parts) != len(self._columns):
            raise ValueError(f"{len(parts)} parts recorded for {len(self._columns)} groups")
        row = self._data[k]
        row[0] = k * self.step_s
        for columns, part in zip(self._columns, parts):  # noqa: B905 - checked above
            row[columns] = part
        self._rows = self._filled[0] = k + 1

    def keep_in(self, path: Path) -> None:
        """Keep the rows in a file from now on, so that they outlive this process; before the first.

        Raises `InputError` where the file cannot be written.
        """
        if self._rows:
            raise ValueError("rows are kept in a file from the first one on, or not at all")
        groups = [
            (name, [(s.name, s.unit, s.description) for s in self.signals_of(name)])
            for name in self.groups
        ]
        description = {"step_s": self.step_s, "groups": groups}
        self._data, self._filled = map_rows(path, description, self._data.shape)

    @classmethod
    def recovered(cls, path: Path) -> Recorder:
        """Return what a recorder has kept in a file, to be read; raises `InputError` where the file
        is no record.
        """
        description, rows = read_rows(path)
        groups = [(name, [Signal(*s) for s in signals]) for name, signals in description["groups"]]
        recorder = cls(groups, 0, description["step_s"])
        recorder._data, recorder._rows = rows, len(rows)
        return recorder

    def group(self, name: str) -> Array:
        """Return the filled rows of a group, a view (rows, signals of the group)."""
        return self._data[: self._rows, self._slices[name]]

    def columns(self, names: Sequence[str]) -> Array:
        """Return the filled rows of signals by name, in that order, (rows, len(names))."""
        known = [signal.name for signal in self.signals]
        return self._data[: self._rows, [known.index(name) for name in names]]

    def car_channels(self, names: Sequence[str]) -> Array:
        """Return the filled rows of channels as the car had them, (rows, len(names)): exact where
        that was recorded, else as measured, before any fault.
        """
        known = {signal.name for signal in self.signals}
        before = ("Ideal.", "Measured.", "")
        found = [next(f"{b}{n}" for b in before if f"{b}{n}" in known or not b) for n in names]
        return self.columns(found)

    def signals_of(self, name: str) -> tuple[Signal, ...]:
        """Return the signals of a group."""
        return self.signals[self._slices[name]]

    def frame(self) -> pd.DataFrame:
        """Return the filled rows, a column per signal name; `attrs["units"]` maps name to unit."""
        import pandas as pd

        names = [signal.name for signal in self.signals]
        frame = pd.DataFrame(self._data[: self._rows].copy(), columns=names)
        frame.attrs["units"] = {signal.name: signal.unit for signal in self.signals}
        return frame

    def write(self, directory: Path, file_format: Format = "csv") -> Path:
        """Write the filled rows to `signals.csv` or `signals.parquet` and return the file.

        CSV carries each number with the fewest digits that read back to the same bits; Parquet
        carries unit and description with each column. Raises `InputError` where pyarrow is missing.
        """
        directory.mkdir(parents=True, exist_ok=True)
        path = directory / f"signals.{file_format}"
        write = self._write_csv if file_format == "csv" else self._write_parquet
        write(path)
        return path

    def _write_csv(self, path: Path) -> None:
        with path.open("w", encoding="utf-8", newline="\n") as stream:
            stream.write(",".join(signal.header for signal in self.signals) + "\n")
            for row in self._data[: self._rows]:
                # what repr() calls, without its detour
                stream.write(",".join(map(float.__repr__, row.tolist())) + "\n")

    def _write_parquet(self, path: Path) -> None:
        require_parquet()
        import pyarrow as pa
        import pyarrow.parquet as pq

        fields = [
            pa.field(s.name, pa.float64(), False, {"unit": s.unit, "description": s.description})
            for s in self.signals
        ]
        columns = [pa.array(column) for column in self._data[: self._rows].T]
        pq.write_table(pa.Table.from_arrays(columns, schema=pa.schema(fields)), path)


def held(commands: Array, initial: Array) -> Array:
    """Return the commands (rows, 4) that were held until each row: a record's `commands` (rows, 4),
    each held from its row on, with `initial` (4,) before them.
    """
    return np.vstack([initial, commands])[: len(commands)]


def require_parquet() -> None:
    """Raise `InputError` with what to do where Parquet cannot be written."""
    import importlib.util

    if importlib.util.find_spec("pyarrow") is None:
        raise InputError(
            "output.format: parquet needs pyarrow; "
            "pip install 'suspension-cosim[parquet]', or choose csv"
        )
