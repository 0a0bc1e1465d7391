"""The pytest plugin, in a pytest of its own: off unless asked for, and what scenarios become."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from importlib import import_module
from pathlib import Path

import pytest
from foreign_fmu import parrot
from loop_rig import write_scenario

ROOT = Path(__file__).parents[1]
PLUGIN = "cosim.regression.pytest_plugin"
HOLDS = "[{metric: largest_deviation_m, max: 1}]"
FAILS = "[{metric: largest_deviation_m, min: 9}]"
CRASHES = "{fmu: p.fmu, parameters: {Parrot.AbortAt: 7}}"


def run_pytest(
    folder: Path, *options: str, plugin: bool = True
) -> subprocess.CompletedProcess[str]:
    """Run pytest as in a folder of somebody else's."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    loaded = ["-p", PLUGIN] if plugin else []
    command = [sys.executable, "-m", "pytest", "-W", "error", *loaded, *options]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A suite with a test in Python, scenarios of all kinds, and YAML that is none."""
    folder = tmp_path_factory.mktemp("suite")
    (folder / "pytest.ini").write_text("[pytest]\n")
    (folder / "test_own.py").write_text("def test_own(): pass\n")
    bench = folder / "bench"
    bench.mkdir()
    runs = "[{kind: passive}, {kind: fixed, command: 0}]"
    sections = {"limits": HOLDS, "controllers": runs}
    write_scenario(bench, name="good", duration="0.3", sections=sections)
    write_scenario(bench, name="bad", duration="0.3", sections={"limits": FAILS})
    parrot(bench / "p.fmu")
    write_scenario(bench, name="crash", sections={"limits": HOLDS, "vehicle": CRASHES})
    write_scenario(bench, name="without")
    hangs = "{fmu: p.fmu, parameters: {Parrot.HangAt: 3}}"
    write_scenario(bench, name="hang", sections={"limits": HOLDS, "vehicle": hangs})
    goldens = "[{signal: Car.az, tolerance: 0.1}]"
    write_scenario(bench, name="golden", duration="0.2", sections={"goldens": goldens})
    wrong = {"limits": "[{signal: Car.azz, max: 1}]"}
    write_scenario(bench, name="wrong", sections=wrong)
    (bench / "other.yaml").write_text("a: 1\n")
    (bench / "torn.yaml").write_text("road: [\n")
    return folder


@pytest.fixture(scope="module")
def asked(suite: Path) -> subprocess.CompletedProcess[str]:
    return run_pytest(suite, "--cosim", "-v", "--cosim-timeout=4", "--junitxml=out.xml")


def test_it_is_found_under_its_entry_point() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    module = project["entry-points"]["pytest11"]["cosim"]
    assert module == PLUGIN
    assert hasattr(import_module(module), "pytest_collect_file")


def test_unasked_it_collects_nothing_and_loads_nothing_heavy(suite: Path) -> None:
    (suite / "conftest.py").write_text(
        "import sys\n"
        "def pytest_sessionfinish():\n"
        "    print('loaded:', sorted({m.split('.')[0] for m in sys.modules} & {'numpy', 'fmpy'}))\n"
    )
    try:
        for options in ((), ("bench/good.yaml", "test_own.py")):
            found = run_pytest(suite, "-q", *options)
            assert "1 passed" in found.stdout or "not found: " in found.stderr
            assert "loaded: []" in found.stdout
        assert "good" not in run_pytest(suite, "--collect-only", "-q").stdout
    finally:
        (suite / "conftest.py").unlink()


def test_a_setting_turns_it_on(suite: Path) -> None:
    found = run_pytest(suite, "-o", "cosim=true", "--collect-only", "-q").stdout
    assert [line for line in found.splitlines() if "::" in line] == [
        "bench/bad.yaml::scenario", "bench/crash.yaml::scenario", "bench/golden.yaml::scenario",
        "bench/good.yaml::scenario", "bench/hang.yaml::scenario", "bench/wrong.yaml::scenario",
        "test_own.py::test_own",
    ]  # fmt: skip


def test_verdicts(asked: subprocess.CompletedProcess[str]) -> None:
    assert asked.returncode == 1
    lines = asked.stdout.splitlines()
    verdicts = {
        line.split("::")[0]: line.split()[1] for line in lines if "::" in line and "%" in line
    }
    assert verdicts == {
        "bench/good.yaml": "PASSED", "bench/bad.yaml": "FAILED", "bench/crash.yaml": "FAILED",
        "bench/wrong.yaml": "FAILED", "bench/hang.yaml": "FAILED", "bench/golden.yaml": "FAILED",
        "test_own.py": "PASSED",
    }  # fmt: skip


def test_failures_are_said_without_the_way_to_them(
    asked: subprocess.CompletedProcess[str], suite: Path
) -> None:
    said = asked.stdout
    assert "bad.yaml: FAILED: passive: largest_deviation_m is " in said
    assert "crash.yaml: the run crashed (SIGABRT, it gave up)" in said
    assert "after the sample at t = 0.06 s" in said
    assert "hang.yaml: the run did not go on for 4 s" in said
    assert "golden.yaml: FAILED: passive: file of goldens is not available (there is none" in said
    assert "'Car.azz' is not a recorded signal; did you mean 'Car.az'?" in said
    assert "Traceback" not in said
    assert "pytest_plugin.py" not in said
    rows = (suite / "results" / "bench" / "crash" / "signals.csv").read_text().splitlines()
    assert len(rows) == 1 + 7


def test_figures_are_properties(asked: subprocess.CompletedProcess[str], suite: Path) -> None:
    root = ET.parse(suite / "out.xml").getroot()
    case = next(c for c in root.iter("testcase") if c.get("classname") == "bench.good.yaml")
    found = {one.get("name"): one.get("value") for one in case.iter("property")}
    assert float(found["passive.simulated_s"] or 0) == 0.3
    assert "fixed.largest_deviation_m" in found


def test_what_is_named_is_run_whatever_is_in_it_and_goldens_are_accepted(suite: Path) -> None:
    files = [f"bench/{name}.yaml" for name in ("without", "torn", "golden")]
    options = ("-q", "-rA", "--cosim-output-dir=elsewhere", "--cosim-accept")
    result = run_pytest(suite, "--cosim", *files, *options)
    assert "1 failed, 2 passed" in result.stdout
    assert "torn.yaml:" in result.stdout
    assert "Car.az is new" in result.stdout
    assert (suite / "elsewhere" / "bench" / "without" / "metrics.json").exists()
    assert (suite / "bench" / "golden" / "golden" / "passive.csv").exists()
