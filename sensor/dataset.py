"""Runs on disk, and windows of them in memory.

A data set is a directory of Parquet files, one per run: a column for each signal of `SIGNALS` (the
14 channels, the production sensors' 11, the damper commands, the `VRel.*` truth, the road below the
wheels), its unit in the field's metadata under `unit`, and the run's recipe as JSON in the schema's
metadata under `recipe`.

In memory all runs lie end to end in one float32 array; a window is only the index of its last
sample, so 19-fold overlap costs nothing. A window never reaches back over the start of its run.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNEL_NAMES, CHANNELS, COMMANDS, OUTPUT_NAMES, OUTPUTS, ROAD, STAGE
from sensor.conditions import Condition, Measurement
from sensor.errors import SensorError

Float32 = npt.NDArray[np.float32]


# The signals of a run, field by field
SIGNALS: Final = {
    "channels": CHANNELS,
    "stage": STAGE,
    "commands": COMMANDS,
    "truth": OUTPUTS,
    "road": ROAD,
}


@dataclass(frozen=True)
class Run:
    """One run: `channels` (samples, 14), `stage` (samples, 11), what production sensors deliver
    before noise, damper `commands` (samples, 4), each held over the interval that ends at its
    sample, `truth` (samples, 4) and the `road` (samples, 4) below the wheels, all in SI units; and
    the recipe that made it.
    """

    name: str
    channels: Float32
    stage: Float32
    commands: Float32
    truth: Float32
    road: Float32
    recipe: Mapping[str, Any] = field(default_factory=dict)

    def measured(self, condition: Condition, seed: int) -> npt.NDArray[np.float64]:
        """Return the 14 channels as a car measures them, (samples, 14): `sensor.conditions`."""
        return Measurement(condition, seed).apply(self.channels, self.stage)


def write_run(path: str | Path, run: Run) -> None:
    """Write a run as Parquet with units and recipe; the same run gives the same bytes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields, columns = [], []
    for group, signals in SIGNALS.items():
        values = getattr(run, group)
        for i, signal in enumerate(signals):
            fields.append(pa.field(signal.name, pa.float32(), metadata={"unit": signal.unit}))
            columns.append(pa.array(np.ascontiguousarray(values[:, i], dtype=np.float32)))
    recipe = json.dumps(dict(run.recipe), sort_keys=True)
    pq.write_table(pa.table(columns, pa.schema(fields, metadata={"recipe": recipe})), path)


def read_run(path: str | Path) -> Run:
    """Read one run; raises SensorError naming every column that is missing, in another unit, or not
    finite.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = Path(path)
    expected = [signal for signals in SIGNALS.values() for signal in signals]
    try:
        schema = pq.read_schema(path)
    except (OSError, pa.ArrowInvalid) as error:
        raise SensorError(f"{path}: it cannot be read as a Parquet file: {error}") from error
    problems = []
    for channel in expected:
        if channel.name not in schema.names:
            problems.append(f"column {channel.name!r} is missing.")
            continue
        unit = (schema.field(channel.name).metadata or {}).get(b"unit", b"").decode()
        if unit != channel.unit:
            problems.append(
                f"column {channel.name!r} is in {unit!r}, where {channel.unit!r} belongs."
            )
    if problems:
        raise SensorError(f"{path}: " + " ".join(problems))
    table = pq.read_table(path, columns=[channel.name for channel in expected])
    values = np.stack([column.to_numpy() for column in table.columns], axis=1).astype(np.float32)
    bad = [
        channel.name for i, channel in enumerate(expected) if not np.isfinite(values[:, i]).all()
    ]
    if bad:
        raise SensorError(f"{path}: column {', '.join(bad)} holds a NaN or an infinity.")
    recipe = json.loads((schema.metadata or {}).get(b"recipe", b"{}"))
    ends = np.cumsum([len(signals) for signals in SIGNALS.values()])
    parts = dict(zip(SIGNALS, np.split(values, ends[:-1], axis=1), strict=True))
    return Run(name=path.stem, recipe=recipe, **parts)


def select_files(directory: str | Path, patterns: Sequence[str]) -> list[Path]:
    """Return the Parquet files whose stem matches one of the glob patterns, sorted by name.

    Raises SensorError naming every pattern that matches no file.
    """
    directory = Path(directory)
    found: set[Path] = set()
    missing = []
    for pattern in patterns:
        matches = set(directory.glob(f"{pattern}.parquet"))
        found |= matches
        if not matches:
            missing.append(f"{pattern!r} matches no Parquet file.")
    if missing:
        raise SensorError(f"{directory}: " + " ".join(missing))
    return sorted(found)


def read_runs(directory: str | Path, patterns: Sequence[str]) -> list[Run]:
    """Read the runs whose file stems match; raises as `select_files` and `read_run` do."""
    return [read_run(path) for path in select_files(directory, patterns)]


def split(runs: Sequence[Run], hold_out: int) -> tuple[list[Run], list[Run]]:
    """Return training and validation runs: every `hold_out`-th is for validation. Raises
    SensorError if there are too few.
    """
    validation = list(runs[hold_out - 1 :: hold_out])
    if not validation:
        raise SensorError(f"of {hold_out} runs one is for validation, but there are {len(runs)}.")
    return [run for i, run in enumerate(runs, 1) if i % hold_out], validation


@dataclass(frozen=True)
class Normalisation:
    """Mean and standard deviation of the channels (14,) and of the truth (4,), in their units;
    never zero.
    """

    input_mean: Float32
    input_std: Float32
    output_mean: Float32
    output_std: Float32

    @classmethod
    def of(cls, runs: Iterable[Run]) -> "Normalisation":
        """Take the figures over all samples of `runs`, in double precision, run by run."""
        runs = list(runs)
        return cls(
            *_mean_and_std([run.channels for run in runs], len(CHANNEL_NAMES)),
            *_mean_and_std([run.truth for run in runs], len(OUTPUT_NAMES)),
        )


def _mean_and_std(parts: Sequence[Float32], width: int) -> tuple[Float32, Float32]:
    """Two passes, since v_x squared minus its mean squared would lose the digits that matter."""
    count = sum(len(part) for part in parts)
    mean = sum((part.sum(axis=0, dtype=np.float64) for part in parts), np.zeros(width)) / count
    square = sum((np.square(part - mean).sum(axis=0) for part in parts), np.zeros(width)) / count
    std = np.sqrt(square)
    std[std < 1e-9] = 1.0  # a channel that never moves carries nothing and must not divide by zero
    return mean.astype(np.float32), std.astype(np.float32)


class WindowSet:
    """Standardised windows of several runs.

    `channels` (samples, 14) and `truth` (samples, 4) hold all runs end to end, standardised; `ends`
    (windows,) the index of each window's last sample.
    """

    def __init__(self, runs: Sequence[Run], window: int, normalisation: Normalisation) -> None:
        short = [
            f"{run.name} has {len(run.channels)}" for run in runs if len(run.channels) < window
        ]
        if short or not runs:
            raise SensorError(
                f"a window needs {window} samples of a run: {', '.join(short) or 'no run'}."
            )
        self.normalisation = normalisation
        total = sum(len(run.channels) for run in runs)
        self.channels = np.empty((total, len(CHANNEL_NAMES)), dtype=np.float32)
        self.truth = np.empty((total, len(OUTPUT_NAMES)), dtype=np.float32)
        self._offsets = np.arange(1 - window, 1)
        ends, start = [], 0
        for run in runs:
            stop = start + len(run.channels)
            n = normalisation
            self.channels[start:stop] = (run.channels - n.input_mean) / n.input_std
            self.truth[start:stop] = (run.truth - n.output_mean) / n.output_std
            ends.append(np.arange(start + window - 1, stop))
            start = stop
        self.ends = np.concatenate(ends)

    def __len__(self) -> int:
        return len(self.ends)

    def take(self, windows: npt.NDArray[np.int64]) -> tuple[Float32, Float32]:
        """Return the chosen windows (n, W, 14) and the truth at their last samples (n, 4), both
        standardised.
        """
        ends = self.ends[windows]
        return self.channels[ends[:, np.newaxis] + self._offsets], self.truth[ends]

    def subset(self, count: int | None, seed: Sequence[int]) -> npt.NDArray[np.int64]:
        """Draw `count` windows (all if None or more than there are), in random order given by
        `seed`.
        """
        order = np.random.default_rng(list(seed)).permutation(len(self))
        return order[:count]

    def batches(
        self, windows: npt.NDArray[np.int64], size: int
    ) -> Iterator[tuple[Float32, Float32]]:
        """Yield the chosen windows in batches of `size`; the last may be smaller."""
        for start in range(0, len(windows), size):
            yield self.take(windows[start : start + size])
