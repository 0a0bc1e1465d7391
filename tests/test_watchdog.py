"""`cosim run` with an FMU that does not come back: its end, its sentence and its record."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from foreign_fmu import parrot
from loop_rig import write_scenario

ROOT = Path(__file__).parents[1]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}
RUNS = "[{kind: passive, name: first}, {kind: passive, name: second}]"


def scenario(folder: Path, orders: str, **sections: str) -> Path:
    parrot(folder / "p.fmu")
    vehicle = f"{{fmu: p.fmu, parameters: {{{orders}}}}}"
    return write_scenario(folder, sections={"vehicle": vehicle, **sections})


def started(path: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "cosim", "run", str(path), *options]
    return subprocess.Popen(
        command, cwd=path.parent, env=ENVIRONMENT, stderr=subprocess.PIPE, text=True
    )


def rows(path: Path) -> int:
    return len(path.read_text().splitlines()) - 1


@pytest.mark.parametrize(
    ("orders", "words", "count"),
    [
        ("Parrot.HangAt: 8", "inside an FMU, in advance (fmi.py, line ", 8),
        ("Parrot.HangAtStart: 1", "inside an FMU, in initialise (fmi.py, line ", 0),
    ],
)
def test_a_hang_ends_with_a_sentence_and_its_rows(
    tmp_path: Path, orders: str, words: str, count: int
) -> None:
    process = started(scenario(tmp_path, orders), "--timeout", "2")
    _, said = process.communicate(timeout=60)
    assert process.returncode == 3, said
    assert said.startswith(f"error: the run did not go on for 2 s {words}")
    signals = tmp_path / "results" / "scenario" / "signals.csv"
    if count:
        assert "after the sample at t = 0.07 s; the 8 samples until then are in " in said
        assert rows(signals) == count
    else:
        assert said.endswith("before its start\n")
        assert not signals.exists()


@pytest.mark.skipif(os.name == "nt", reason="needs signals")
def test_ctrl_c_reaches_an_fmu_that_hangs(tmp_path: Path) -> None:
    path = scenario(tmp_path, "Parrot.HangAt: 8", controllers=RUNS)
    process = started(path)
    written = tmp_path / "results" / "scenario" / "versions.json"
    for _ in range(3000):
        if written.exists():
            break
        time.sleep(0.02)
    time.sleep(1.0)  # until the eighth sample
    begin = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert said.startswith("error: the run first was interrupted inside an FMU, in advance")
    assert time.monotonic() - begin < 20
    assert rows(written.parent / "first" / "signals.csv") == 8


@pytest.mark.skipif(os.name == "nt", reason="needs signals")
def test_ctrl_c_without_a_hang_is_not_the_watchdogs(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, duration="9", sections={"real_time": "{factor: 0.5}"})
    process = started(path)
    for _ in range(3000):
        if (tmp_path / "results" / "scenario" / "versions.json").exists():
            break
        time.sleep(0.02)
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (
        130, "interrupted; what was recorded until then is on disk\n",
    )  # fmt: skip
    assert rows(tmp_path / "results" / "scenario" / "signals.csv") > 1


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="needs signals")
def test_a_process_that_was_stopped_has_not_hung(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, duration="2", sections={"real_time": "{overrun: slip}"})
    process = started(path, "--timeout", "1")
    for _ in range(3000):
        if (tmp_path / "results" / "scenario" / "versions.json").exists():
            break
        time.sleep(0.02)
    time.sleep(0.7)
    process.send_signal(signal.SIGSTOP)
    time.sleep(2.5)
    process.send_signal(signal.SIGCONT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 0, said


def test_to_wait_for_a_sensor_on_a_bus_is_no_hang(tmp_path: Path) -> None:
    path = write_scenario(
        tmp_path, sections={"sensor": "{bus: {interface: virtual, connect_s: 3}}"}
    )
    process = started(path, "--timeout", "1")
    _, said = process.communicate(timeout=60)
    assert process.returncode == 3
    assert said == (
        "error: no sensor answers on bus virtual within 3 s; start it with cosim sensor-node\n"
    )
