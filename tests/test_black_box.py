"""Records in a file: what outlives a process that is killed (cosim.black_box)."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cosim.black_box import filled
from cosim.errors import InputError
from cosim.recorder import Recorder, Signal

GROUPS = [
    ("channels", [Signal("Car.ax", "m/s2", "Längsbeschleunigung"), Signal("Car.vx", "m/s")]),
    ("valid", [Signal("Sensor.Valid", "")]),
]


def kept(path: Path, rows: int, of: int = 100) -> Recorder:
    recorder = Recorder(GROUPS, of)
    recorder.keep_in(path)
    for k in range(rows):
        recorder.append(k, [k + 0.1, -k], k > 3)
    return recorder


@pytest.mark.parametrize("rows", [0, 1, 7, 100])
def test_what_comes_back_is_what_was_recorded(tmp_path: Path, rows: int) -> None:
    path = tmp_path / "below" / "signals.part"
    recorder = kept(path, rows)
    assert filled(path) == rows
    back = Recorder.recovered(path)
    assert (back.rows, back.step_s, back.signals) == (rows, recorder.step_s, recorder.signals)
    assert back.groups == recorder.groups
    for name in recorder.groups:
        np.testing.assert_array_equal(back.group(name), recorder.group(name))
    for one, folder in ((recorder, "first"), (back, "second")):
        one.write(tmp_path / folder)
    files = [(tmp_path / folder / "signals.csv").read_bytes() for folder in ("first", "second")]
    assert files[0] == files[1]


def test_rows_outlive_a_process_that_is_killed(tmp_path: Path) -> None:
    path = tmp_path / "signals.part"
    program = (
        "import os, signal\nfrom pathlib import Path\nimport test_black_box as t\n"
        f"t.kept(Path({str(path)!r}), 42, 1000)\nos.kill(os.getpid(), signal.SIGKILL)"
    )
    root = Path(__file__).parents[1]
    search = os.pathsep.join([str(root), str(root / "tests")])
    environment = {**os.environ, "PYTHONPATH": search}
    ended = subprocess.run([sys.executable, "-c", program], env=environment, check=False)
    assert ended.returncode == -signal.SIGKILL
    back = Recorder.recovered(path)
    assert back.rows == 42
    np.testing.assert_array_equal(back.group("channels")[:, 0], np.arange(42) + 0.1)


def test_what_is_no_record(tmp_path: Path) -> None:
    path = tmp_path / "x.part"
    assert filled(path) == 0
    path.write_bytes(b"short")
    assert filled(path) == 0
    for content in (b"short", b"something else, but long enough"):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"x\.part: not the record of a run"):
            Recorder.recovered(path)


def test_where_nothing_can_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write to"):
        kept(tmp_path / "file" / "signals.part", 0)
    recorder = Recorder(GROUPS, 3)
    recorder.append(0, [1, 2], 1)
    with pytest.raises(ValueError, match="from the first one on"):
        recorder.keep_in(tmp_path / "late.part")
