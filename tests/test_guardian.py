"""`cosim run` of one scenario whose process does not come to its end: its sentence and its rows."""

from __future__ import annotations

import os
import re
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
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")


def started(folder: Path, orders: str, **sections: str) -> subprocess.Popen[str]:
    parrot(folder / "p.fmu")
    vehicle = f"{{fmu: p.fmu, parameters: {{{orders}}}}}"
    path = write_scenario(folder, sections={"vehicle": vehicle, **sections})
    return run(path)


def run(path: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "cosim", "run", str(path)],
        cwd=path.parent, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def rows(path: Path) -> int:
    return len(path.read_text().splitlines()) - 1


@pytest.mark.parametrize(
    ("order", "manner"),
    [
        ("SegfaultAt", "crashed (SIGSEGV, memory that is not its own) inside an FMU, in advance"),
        ("AbortAt", "crashed (SIGABRT, it gave up) inside an FMU, in advance"),
        ("ExitAt", "ended the whole process"),
    ],
)
def test_a_run_that_takes_its_process_with_it_leaves_its_rows(
    tmp_path: Path, order: str, manner: str
) -> None:
    process = started(tmp_path, f"Parrot.{order}: 8")
    _, said = process.communicate(timeout=60)
    results = tmp_path / "results" / "scenario"
    assert process.returncode == 3, said
    assert f"error: the run {manner}" in said
    assert "after the sample at t = 0.07 s; the 8 samples until then are in " in said
    assert rows(results / "signals.csv") == 8
    assert not (results / "signals.part").exists()


def test_the_run_under_way_is_the_one_that_is_named(tmp_path: Path) -> None:
    chosen = "[{kind: passive, name: first}, {kind: fixed, command: 0, name: second}]"
    process = started(tmp_path, "Parrot.SegfaultAt: 0", controllers=chosen)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 0, said  # no order: the whole scenario, and no file left behind
    results = tmp_path / "results" / "scenario"
    assert {path.name for path in results.rglob("signals.*")} == {"signals.csv"}
    process = started(tmp_path, "Parrot.SegfaultAt: 8", controllers=chosen)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 3
    assert "error: the run first crashed (SIGSEGV" in said
    assert rows(results / "first" / "signals.csv") == 8


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 130)])
def test_a_signal_to_the_process_that_waits_reaches_the_run(
    tmp_path: Path, number: signal.Signals, code: int
) -> None:
    clock = {"real_time": "{factor: 0.5}"}
    process = run(write_scenario(tmp_path, duration="9", sections=clock))
    results = tmp_path / "results" / "scenario"
    _wait_for(results / "signals.part")
    time.sleep(1.0)
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert process.returncode == code, said
    assert "interrupted" in said
    assert rows(results / "signals.csv") > 1
    assert not (results / "signals.part").exists()


@pytest.mark.skipif(sys.platform != "linux", reason="needs prctl")
def test_a_run_does_not_go_on_alone(tmp_path: Path) -> None:
    clock = {"real_time": "{factor: 0.5}"}
    process = run(write_scenario(tmp_path, duration="9", sections=clock))
    _wait_for(tmp_path / "results" / "scenario" / "signals.part")
    listed = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    process.kill()
    process.communicate(timeout=60)
    for _ in range(200):
        if not any(_runs(int(child)) for child in listed):
            break
        time.sleep(0.02)
    assert listed
    assert not any(_runs(int(child)) for child in listed)


def _wait_for(path: Path) -> None:
    for _ in range(3000):
        if path.exists():
            return
        time.sleep(0.02)
    pytest.fail(f"{path.name} was not written")


def _runs(process: int) -> bool:
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except FileNotFoundError:
        return False
    return re.search(r"^State:\s+Z", status, re.MULTILINE) is None


def test_bad_input_is_told_once(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, duration="-1")
    process = run(path)
    out, said = process.communicate(timeout=60)
    assert process.returncode == 2
    assert (out, said.count("error: ")) == ("", 1)
