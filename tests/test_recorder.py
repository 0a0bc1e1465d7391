import sys
import time

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from cosim.errors import InputError
from cosim.recorder import Recorder, Signal

GROUPS = (
    ("channels", [Signal("Car.ax", "m/s2", "acceleration"), Signal("Car.vx", "m/s")]),
    ("valid", [Signal("Sensor.Valid", "")]),
)


def filled(values):
    recorder = Recorder(GROUPS, rows=len(values))
    for k, row in enumerate(values):
        recorder.append(k, row[:2], row[2])
    return recorder


def test_time_is_the_row_times_the_step():
    recorder = filled(np.zeros((1000, 3)))
    assert all(recorder.time[k] == k * 0.01 for k in range(1000))


def test_groups_are_views_of_the_filled_rows_only():
    recorder = Recorder(GROUPS, rows=5)
    recorder.append(0, [1.0, 2.0], True)
    recorder.append(1, np.array([3.0, 4.0]), False)
    assert recorder.rows == 2
    np.testing.assert_array_equal(recorder.group("channels"), [[1, 2], [3, 4]])
    np.testing.assert_array_equal(recorder.group("valid"), [[1], [0]])
    assert recorder.group("channels").base is recorder.group("valid").base


def test_parts_are_copied():
    recorder, part = Recorder(GROUPS, rows=2), np.array([1.0, 2.0])
    recorder.append(0, part, 1)
    part[:] = 9
    np.testing.assert_array_equal(recorder.group("channels"), [[1, 2]])


def test_rows_come_in_order_and_parts_complete():
    recorder = Recorder(GROUPS, rows=3)
    with pytest.raises(ValueError, match="row 1 recorded after 0 rows"):
        recorder.append(1, [1, 2], 1)
    with pytest.raises(ValueError, match="1 parts recorded for 2 groups"):
        recorder.append(0, [1, 2])


def test_a_name_in_two_groups_is_refused():
    with pytest.raises(ValueError, match=r"recorded twice: Car\.ax"):
        Recorder((*GROUPS, ("again", [Signal("Car.ax", "m/s2")])), rows=1)


def test_csv_heads_columns_with_units(tmp_path):
    path = filled(np.zeros((1, 3))).write(tmp_path, "csv")
    assert path.read_text().splitlines() == [
        "time [s],Car.ax [m/s2],Car.vx [m/s],Sensor.Valid",
        "0.0,0.0,0.0,0.0",
    ]


@settings(deadline=None)
@given(hnp.arrays(np.float64, (3, 3), elements=st.floats(allow_infinity=False)))
def test_csv_reads_back_to_the_same_bits(tmp_path_factory, values):
    recorder = filled(values)
    path = recorder.write(tmp_path_factory.mktemp("csv"), "csv")
    read = [[float(cell) for cell in line.split(",")] for line in path.read_text().splitlines()[1:]]
    np.testing.assert_array_equal(np.array(read)[:, 1:], values)


def test_csv_opens_in_pandas(tmp_path):
    frame = pd.read_csv(filled(np.array([[1.0, np.nan, 0.0]])).write(tmp_path, "csv"))
    assert frame["Car.ax [m/s2]"][0] == 1
    assert frame["Car.vx [m/s]"].isna().all()


def test_parquet_carries_units(tmp_path):
    import pyarrow.parquet as pq

    values = np.random.default_rng(1).standard_normal((4, 3))
    table = pq.read_table(filled(values).write(tmp_path, "parquet"))
    assert table.schema.field("Car.ax").metadata == {
        b"unit": b"m/s2",
        b"description": b"acceleration",
    }
    np.testing.assert_array_equal(table.to_pandas().to_numpy()[:, 1:], values)


def test_parquet_without_pyarrow_says_what_to_do(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"pip install 'suspension-cosim\[parquet\]'"):
        filled(np.zeros((1, 3))).write(tmp_path, "parquet")


def test_frame_names_and_units():
    frame = filled(np.ones((2, 3))).frame()
    assert list(frame.columns) == ["time", "Car.ax", "Car.vx", "Sensor.Valid"]
    assert frame.attrs["units"]["Car.ax"] == "m/s2"


def test_a_lap_is_written_in_seconds(tmp_path):
    columns = [Signal(f"s{i}", "m/s") for i in range(50)]
    recorder = Recorder([("all", columns)], rows=12_000)
    for k, row in enumerate(np.random.default_rng(1).standard_normal((12_000, 50))):
        recorder.append(k, row)
    start = time.perf_counter()
    recorder.write(tmp_path, "csv")
    assert time.perf_counter() - start < 5  # about 0.6 s alone on a desktop processor
