from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sensor.channels import CHANNEL_NAMES
from sensor.dataset import (
    SIGNALS,
    Normalisation,
    Run,
    WindowSet,
    read_run,
    read_runs,
    write_run,
)
from sensor.errors import SensorError

PLAIN = Normalisation(
    *(np.full(width, value, dtype=np.float32) for width in (14, 4) for value in (0.0, 1.0))
)


def numbered(name: str, first: int, count: int) -> Run:
    """A run whose every sample carries its own number."""
    numbers = np.arange(first, first + count, dtype=np.float32)[:, np.newaxis]
    groups = {group: np.tile(numbers, (1, len(signals))) for group, signals in SIGNALS.items()}
    return Run(name, **groups, recipe={"style": name})


def test_written_run_is_read_back(tmp_path: Path) -> None:
    write_run(tmp_path / "a.parquet", numbered("a", 0, 30))
    write_run(tmp_path / "again.parquet", numbered("a", 0, 30))
    run = read_run(tmp_path / "a.parquet")
    for group in SIGNALS:
        np.testing.assert_array_equal(getattr(run, group), getattr(numbered("a", 0, 30), group))
    assert (run.name, run.recipe) == ("a", {"style": "a"})
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "again.parquet").read_bytes()


def test_files_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    write_run(path, numbered("a", 0, 30))
    table = pq.read_table(path)
    renamed = table.rename_columns(["Car.ax ", *table.column_names[1:]])
    degrees = pa.field("Car.YawRate", pa.float32(), metadata={"unit": "deg/s"})
    pq.write_table(renamed.set_column(5, degrees, table.column(5)), path)
    with pytest.raises(SensorError) as caught:
        read_run(path)
    for part in ("a.parquet", "'Car.ax' is missing", "'Car.YawRate' is in 'deg/s'", "'rad/s'"):
        assert part in str(caught.value)
    spoiled = numbered("a", 0, 30)
    spoiled.channels[3, CHANNEL_NAMES.index("Car.vx")] = np.nan
    write_run(path, spoiled)
    with pytest.raises(SensorError, match=r"Car\.vx holds a NaN"):
        read_run(path)
    path.write_text("no table")
    with pytest.raises(SensorError, match="cannot be read"):
        read_run(path)


def test_selection_by_pattern(tmp_path: Path) -> None:
    for name in ("track_calm_smooth", "track_calm_rough", "other_calm_smooth"):
        write_run(tmp_path / f"{name}.parquet", numbered(name, 0, 30))
    runs = read_runs(tmp_path, ["track_*_smooth", "*_calm_smooth"])
    assert [run.name for run in runs] == ["other_calm_smooth", "track_calm_smooth"]
    with pytest.raises(SensorError, match=r"'nowhere_\*' matches no"):
        read_runs(tmp_path, ["track_*", "nowhere_*"])


def test_windows_never_cross_runs() -> None:
    runs = [numbered("a", 0, 30), numbered("b", 1000, 19), numbered("c", 2000, 25)]
    windows = WindowSet(runs, 19, PLAIN)
    assert len(windows) == 12 + 1 + 7
    measured, truth = windows.take(np.arange(len(windows)))
    assert measured.shape == (20, 19, 14)
    np.testing.assert_array_equal(np.diff(measured[:, :, 0], axis=1), 1.0)
    np.testing.assert_array_equal(measured[:, -1, :4], truth)


def test_subsets_are_seeded_and_batches_complete() -> None:
    windows = WindowSet([numbered("a", 0, 200)], 19, PLAIN)
    first = windows.subset(50, (1, 0))
    np.testing.assert_array_equal(first, windows.subset(50, (1, 0)))
    assert not np.array_equal(first, windows.subset(50, (1, 1)))
    assert len(set(first.tolist())) == 50
    assert len(windows.subset(None, (1,))) == len(windows)
    seen = np.concatenate([truth[:, 0] for _, truth in windows.batches(first, 16)])
    np.testing.assert_array_equal(seen, first + 18)


def test_short_runs_are_refused() -> None:
    with pytest.raises(SensorError, match="b has 18"):
        WindowSet([numbered("a", 0, 30), numbered("b", 0, 18)], 19, PLAIN)
    with pytest.raises(SensorError, match="no run"):
        WindowSet([], 19, PLAIN)


def test_normalisation_is_that_of_all_samples_together() -> None:
    rng = np.random.default_rng(0)
    parts: list[npt.NDArray[np.float32]] = [
        rng.normal(30.0, 1e-2, (n, 14)).astype(np.float32) for n in (100, 300)
    ]
    for part in parts:
        part[:, 3] = 7.0
    norm = Normalisation.of(
        [replace(numbered("r", 0, 1), channels=p, truth=p[:, :4]) for p in parts]
    )
    pooled = np.concatenate(parts).astype(np.float64)
    np.testing.assert_allclose(norm.input_mean, pooled.mean(axis=0), rtol=1e-6)
    assert norm.input_std[3] == 1.0
    np.testing.assert_allclose(np.delete(norm.input_std, 3), np.delete(pooled.std(axis=0), 3), 1e-4)
