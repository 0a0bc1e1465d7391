"""`cosim test`: verdicts over real runs, FMUs that crash and hang among them, and their XML."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from foreign_fmu import parrot
from loop_rig import write_scenario
from lxml import etree

from cosim.batch.job import Ended, Job, RunEnd
from cosim.cli import main
from cosim.isolation import Death
from cosim.regression.junit import write_junit

SCHEMA = Path(__file__).parent / "junit.xsd"
PASSES = "[{metric: largest_deviation_m, max: 1}, {signal: Car.vx, min: 13, max: 15}]"
FAILS = "[{metric: largest_deviation_m, min: 9}, {signal: Car.vx, statistic: final, min: 15}]"
ORDERS = {
    "aborts": "Parrot.AbortAt: 57", "segfaults": "Parrot.SegfaultAt: 1",
    "hangs": "Parrot.HangAt: 8", "hangs_at_start": "Parrot.HangAtStart: 1",
    "exits": "Parrot.ExitAt: 30",
    "fails": "Parrot.FailAt: 20, Parrot.FailStatus: 3, Parrot.FailWords: 1",
}  # fmt: skip
TIMEOUT = 6.0


def cosim(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["test", *arguments])


@dataclass(frozen=True)
class Outcome:
    folder: Path
    result: Result

    def ended(self) -> dict[str, dict[str, Any]]:
        return {Path(one["scenario"]).stem: one for one in json.loads(self.result.stdout)}

    def rows(self, name: str) -> list[str]:
        return (self.folder / "results" / name / "signals.csv").read_text().splitlines()

    def sentence(self, name: str) -> str:
        (said,) = self.ended()[name]["problems"]
        return str(said)

    def suites(self) -> dict[str, Any]:
        root = etree.parse(str(self.folder / "out" / "junit.xml")).getroot()
        return {suite.get("name"): suite for suite in root}


@pytest.fixture(scope="module")
def tested(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """All that can become of a test, in one command."""
    folder = tmp_path_factory.mktemp("tested")
    bench = folder / "bench"
    bench.mkdir()
    write_scenario(bench, name="good", sections={"limits": PASSES})
    write_scenario(bench, name="bad", sections={"limits": FAILS})
    runs = "[{kind: passive}, {kind: fixed, command: 0}]"
    write_scenario(
        bench, name="two", duration="0.3", sections={"limits": PASSES, "controllers": runs}
    )
    write_scenario(bench, name="without")
    (bench / "torn.fmu").write_text("no FMU")
    parrot(bench / "p.fmu")
    for name, orders in ORDERS.items():
        sections = {"vehicle": f"{{fmu: p.fmu, parameters: {{{orders}}}}}", "limits": PASSES}
        write_scenario(bench, name=name, sections=sections)
    sections = {"vehicle": "{fmu: torn.fmu}", "limits": PASSES}
    write_scenario(bench, name="torn", sections=sections)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        result = cosim("bench", "--jobs", "2", "--timeout", str(TIMEOUT), "--json",
                       "--junitxml", "out/junit.xml")  # fmt: skip
    return Outcome(folder, result)


def test_one_that_fails_is_enough_for_exit_code_1(tested: Outcome) -> None:
    assert tested.result.exit_code == 1, tested.result.stderr
    failed = {name for name, one in tested.ended().items() if one["exit_code"]}
    assert failed == {"bad", "torn", *ORDERS}
    assert "8 of 10 tests FAILED; results in results" in tested.result.stderr
    assert "note: 1 file has neither limits nor goldens; left out" in tested.result.stderr
    assert "Traceback" not in tested.result.stderr


def test_the_verdict_table(tested: Outcome) -> None:
    lines = [line.split() for line in tested.result.stderr.splitlines() if ".yaml" in line]
    found = {words[0].removeprefix("bench/").removesuffix(".yaml"): words for words in lines
             if words[0].startswith("bench/") and not words[0].endswith(":")}  # fmt: skip
    assert found["good"][1:6] == ["passed", "2", "of", "2", "1.0"]
    assert found["bad"][1:6] == ["FAILED", "0", "of", "2", "1.0"]
    assert found["two"][1:3] == ["(fixed)", "passed"]
    assert found["aborts"][1:4] == ["error", "-", "0.6"]
    assert found["torn"][1:4] == ["error", "-", "-"]


def test_what_failed_is_said(tested: Outcome) -> None:
    said = tested.result.stderr
    assert "bench/bad.yaml: FAILED: passive: largest_deviation_m is " in said
    assert ", required at least 9 m\n" in said
    assert "bench/bad.yaml: FAILED: passive: final of Car.vx is " in said
    assert "error: bench/fails.yaml: p.fmu: could not step at t = 0.19 s: the parrot fell" in said
    assert "error: bench/torn.yaml: bench/torn.fmu: not a readable FMU" in said


@pytest.mark.parametrize(
    ("name", "manner", "last", "rows"),
    [
        ("aborts", "crashed (SIGABRT, it gave up)", "after the sample at t = 0.56 s", 57),
        ("segfaults", "crashed (SIGSEGV, memory that", "after the sample at t = 0 s", 1),
        ("hangs", "did not go on for 6 s", "after the sample at t = 0.07 s", 8),
        ("exits", "ended the whole process", "after the sample at t = 0.29 s", 30),
    ],
)
def test_a_crash_or_a_hang_is_told_and_its_rows_are_there(
    tested: Outcome, name: str, manner: str, last: str, rows: int
) -> None:
    said = tested.sentence(name)
    assert said.startswith(f"the run {manner}")
    assert last in said
    if name != "exits":
        assert "(fmi.py, line " in said
    assert said.endswith(f"results/{name}/signals.csv")
    lines = tested.rows(name)
    assert len(lines) == 1 + rows
    assert lines[0] == tested.rows("good")[0]
    assert all(line.count(",") == lines[0].count(",") for line in lines)
    assert lines[-1].startswith(f"{(rows - 1) * 0.01!r}," if rows > 1 else "0.0,")
    assert not list((tested.folder / "results").rglob("*.part"))
    for file in ("scenario.resolved.yaml", "versions.json"):
        assert (tested.folder / "results" / name / file).exists()


def test_an_fmu_that_hangs_before_its_start(tested: Outcome) -> None:
    assert "did not go on for 6 s in connect (vehicle.py" in tested.sentence("hangs_at_start") or (
        "did not go on for 6 s inside an FMU, in initialise (fmi.py"
        in tested.sentence("hangs_at_start")
    )
    assert tested.sentence("hangs_at_start").endswith("before its start")
    assert not (tested.folder / "results" / "hangs_at_start" / "signals.csv").exists()


# ---------------------------------------------------------------- as XML


def test_the_xml_keeps_to_the_schema(tested: Outcome) -> None:
    schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
    schema.assertValid(etree.parse(str(tested.folder / "out" / "junit.xml")))
    assert set(tested.suites()) == {
        "good", "bad", "two (passive)", "two (fixed)", "torn", *ORDERS,
    }  # fmt: skip


def test_a_case_for_the_run_and_each_limit(tested: Outcome) -> None:
    suites = tested.suites()
    good, bad = suites["good"], suites["bad"]
    names = ["runs to its end", "largest_deviation_m", "Car.vx"]
    assert [case.get("name") for case in good.iter("testcase")] == names
    assert {case.get("classname") for case in good.iter("testcase")} == {"bench.good"}
    assert (good.get("tests"), good.get("failures"), good.get("errors")) == ("3", "0", "0")
    assert (bad.get("tests"), bad.get("failures"), bad.get("errors")) == ("3", "2", "0")
    failure = bad.find("testcase/failure").get("message")
    assert failure.endswith("required at least 9 m")
    crashed = suites["aborts"]
    assert (crashed.get("tests"), crashed.get("errors")) == ("1", "1")
    error = crashed.find("testcase/error")
    assert error.get("type") == "crash"
    assert "SIGABRT" in error.get("message")
    assert "fmi.py" in crashed.findtext("system-err")
    assert "Extension modules" not in crashed.findtext("system-err")
    assert suites["hangs"].find("testcase/error").get("type") == "hang"


@pytest.mark.parametrize(
    ("path", "package", "name"),
    [
        ("bench/v1.2/a.yaml", "bench.v1_2", "bench.v1_2.a"),
        ("{here}/bench/a.b.yaml", "bench", "bench.a_b"),
        ("a.yaml", ".", "a"),
        ("../other/a.yaml", "other", "other.a"),
        ("/elsewhere/bench/a.yaml", "elsewhere.bench", "elsewhere.bench.a"),
    ],
)
def test_a_build_server_sees_folders_as_packages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: str, package: str, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    job = Job(Path(path.format(here=tmp_path)), tmp_path)
    ended = Ended(job, 0, (), {"runs": {"a": {}}, "limits": []}, (), (RunEnd("a", {}),))
    write_junit(Path("x.xml"), [ended], datetime(2020, 1, 2))
    (suite,) = etree.parse("x.xml").getroot()
    assert (suite.get("package"), suite[1].get("classname")) == (package, name)


def test_figures_are_properties(tested: Outcome) -> None:
    suites = tested.suites()
    for name, stem, run in (("good", "good", "passive"), ("two (fixed)", "two", "fixed")):
        found = {one.get("name"): one.get("value") for one in suites[name].iter("property")}
        figures = tested.ended()[stem]["metrics"]["runs"][run]
        assert float(found["largest_deviation_m"]) == figures["largest_deviation_m"]
        step = found["timing.step_p99_ms"]
        assert float(step) == figures["timing"]["step_p99_ms"]
        assert found["scenario"] == f"bench/{stem}.yaml"
    crashed = {one.get("name"): one.get("value") for one in suites["aborts"].iter("property")}
    assert crashed["last_sample_s"] == "0.56"


def test_whatever_is_said_fits_into_xml(tmp_path: Path) -> None:
    """An FMU may print anything; two limits may be on one figure."""
    limits = [
        {"run": "a", "metric": "x_m", "value": v, "min": None, "max": 1.0, "passed": v < 1}
        for v in (0.5, 2.0)
    ]
    death = Death("crash", "SIGSEGV", printed="\x1b[31m]]> & <b>\x00\ud800")
    runs = (
        RunEnd("a", {"x_m": 2.0}),
        RunEnd("b", exit_code=3, problems=(f"b: {death.said}",), death=death),
    )
    job = Job(tmp_path / "with space & <.yaml", tmp_path)
    ended = Ended(job, 3, (), {"runs": {"a": {"x_m": 2.0}}, "limits": limits}, ("<",), runs)
    write_junit(tmp_path / "x.xml", [ended, Ended(job, 2, ("wrong\n",))], datetime(2020, 1, 2))
    document = etree.parse(str(tmp_path / "x.xml"))
    etree.XMLSchema(etree.parse(str(SCHEMA))).assertValid(document)
    names = [case.get("name") for case in document.getroot()[0].iter("testcase")]
    assert names == ["runs to its end", "x_m", "x_m #2"]
    assert "?[31m]]> & <b>??" in document.getroot()[1].find("testcase/error").get("message")


# ---------------------------------------------------------------- the command


def test_bad_input_comes_before_any_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_scenario(tmp_path, name="fine", sections={"limits": PASSES})
    write_scenario(tmp_path, name="wrong", sections={"limits": "[{signal: Car.azz, max: 1}]"})
    result = cosim(".", "--junitxml", "x.xml")
    assert result.exit_code == 2
    assert "error: wrong.yaml:5:" in result.stderr
    assert not Path("results").exists()
    etree.XMLSchema(etree.parse(str(SCHEMA))).assertValid(etree.parse("x.xml"))


def test_where_there_is_nothing_to_test(tmp_path: Path) -> None:
    path = write_scenario(tmp_path)
    result = cosim(str(tmp_path))
    assert result.exit_code == 2
    assert "no scenario with limits or goldens" in result.stderr
    (tmp_path / "empty").mkdir()
    assert "there is no scenario in the folder" in cosim(str(tmp_path / "empty")).stderr
    assert "/scenario.yaml'?" in cosim(str(tmp_path / "scenaro.yaml")).stderr
    named = cosim(str(path), "--output-dir", str(tmp_path / "out"))
    assert named.exit_code == 0, named.stderr
    assert "1 test passed" in named.stderr


def test_those_by_the_clock_have_the_machine_to_themselves(tmp_path: Path) -> None:
    limits = "[{metric: timing.overruns, min: 0}]"
    for name in ("a", "b"):
        sections = {"real_time": "{factor: 2}", "limits": limits}
        write_scenario(tmp_path, name=name, sections=sections)
    write_scenario(tmp_path, name="free", duration="2", sections={"limits": PASSES})
    result = cosim(str(tmp_path), "--jobs", "2", "--output-dir", str(tmp_path / "out"))
    assert result.exit_code == 0, result.stderr
    written = {
        name: (tmp_path / "out" / name / "signals.csv").stat().st_mtime_ns
        for name in ("a", "b", "free")
    }
    assert written["free"] < min(written["a"], written["b"])
    assert abs(written["a"] - written["b"]) >= 0.5e9


@pytest.mark.skipif(not hasattr(signal, "SIGINT") or os.name == "nt", reason="needs signals")
def test_an_interrupt_leaves_what_was_recorded(tmp_path: Path) -> None:
    parrot(tmp_path / "p.fmu")
    vehicle = "{fmu: p.fmu, parameters: {Parrot.HangAt: 8}}"
    path = write_scenario(tmp_path, sections={"vehicle": vehicle, "limits": PASSES})
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    command = [sys.executable, "-m", "cosim", "test", str(path)]
    process = subprocess.Popen(
        command, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True
    )
    box = tmp_path / "results" / "scenario" / "signals.part"
    for _ in range(3000):
        if box.exists() and box.stat().st_size and box.read_bytes()[8] == 8:
            break
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted; what was recorded until then is on disk" in said
    assert len((box.parent / "signals.csv").read_text().splitlines()) == 1 + 8
    assert not box.exists()


def test_to_wait_for_a_sensor_on_a_bus_is_no_hang(tmp_path: Path) -> None:
    sections = {"sensor": "{bus: {interface: virtual, connect_s: 3}}"}
    path = write_scenario(tmp_path, sections=sections)
    result = cosim(str(path), "--timeout", "1", "--output-dir", str(tmp_path / "out"))
    assert result.exit_code == 1
    assert "no sensor answers on bus virtual within 3 s" in result.stderr
