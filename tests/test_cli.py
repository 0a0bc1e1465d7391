import json
import subprocess
import sys
import time
import types
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from stand_in_assembly import StandIn

from cosim.cli import main
from cosim.errors import InputError
from sensor import SensorError

SCENARIO = """\
name: a lap
road: {track: hockenheim}
"""
CLOSED_LOOP = SCENARIO + "controllers: [{kind: passive}, {kind: skyhook, feedback: truth}]\n"


@pytest.fixture
def cosim(tmp_path, monkeypatch):
    """Run the command line in an empty folder, with the stand-in for the blocks of a run."""
    monkeypatch.chdir(tmp_path)
    module = types.ModuleType("cosim.assembly")
    module.assemble = lambda *_: StandIn()
    monkeypatch.setitem(sys.modules, "cosim.assembly", module)
    Path("lap.yaml").write_text(SCENARIO)
    Path("loop.yaml").write_text(CLOSED_LOOP)

    def run(*arguments, assemble=None):
        if assemble is not None:
            module.assemble = assemble
        return CliRunner().invoke(main, ["run", *arguments])

    return run


def test_results_and_exit_code_0(cosim):
    result = cosim("lap.yaml")
    assert result.exit_code == 0, result.output
    written = {path.name for path in Path("results/lap").iterdir()}
    assert {
        "signals.csv",
        "metrics.json",
        "scenario.resolved.yaml",
        "versions.json",
        "report.html",
    } <= written
    assert result.stdout == ""
    assert "no limits set; results in results/lap" in result.stderr


def test_json_on_stdout_is_metrics_json(cosim):
    result = cosim("lap.yaml", "--json", "--output-dir", "out")
    assert json.loads(result.stdout) == json.loads(Path("out/metrics.json").read_text())


def test_the_sensor_that_the_run_had_is_named(cosim):
    assert "Sensor: carried, channels measured in condition ideal." in cosim("lap.yaml").stderr
    Path("s.fmu").touch()
    named = cosim("lap.yaml", "--set", "sensor={fmu: s.fmu}").stderr
    assert "Sensor: s.fmu, channels measured in condition ideal." in named
    own = cosim("lap.yaml", "--set", "controllers=[{kind: passive, estimator: fir_w64}]").stderr
    assert "Sensor: fir_w64, channels measured in condition ideal." in own


def test_plain_text_without_a_terminal(cosim):
    assert "\x1b" not in cosim("lap.yaml").stderr


def test_exit_code_1_when_a_limit_fails(cosim):
    result = cosim("lap.yaml", "--set", "limits=[{metric: zero.overall.accuracy_percent, min: 50}]")
    assert result.exit_code == 1
    assert "1 of 1 limits FAILED" in result.stderr


def test_limits_for_another_surface_are_left_out_and_said(cosim):
    limits = "limits=[{metric: zero.overall.accuracy_percent, min: 50, surface: A}]"
    result = cosim("lap.yaml", "--set", limits)
    assert result.exit_code == 0
    assert "note: 1 limit is for another surface (A) and left out on smooth" in result.stderr
    assert "no limits that count here" in result.stderr
    assert "left out on smooth" in Path("results/lap/report.html").read_text()
    result = cosim("lap.yaml", "--set", limits, "--set", "road.surface=A")
    assert result.exit_code == 1
    assert "(surface A)" in result.stderr
    assert json.loads(Path("results/lap/metrics.json").read_text())["limits"][0]["surface"] == "A"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["gone.yaml"], "error: gone.yaml: no such scenario file"),
        (["lap.yml"], "did you mean 'lap.yaml'?"),
        (["lap.yaml", "--duration", "-1"], "error: --duration -1: duration must be"),
        (["lap.yaml", "--set", "driver.style=fast"], "error: --set driver.style=fast: "),
        (["lap.yaml", "--output-dir", "lap.yaml"], "error: cannot write to 'lap.yaml'"),
        (["lap.yaml", "--sett", "a=1"], "No such option"),
        ([], "Missing argument 'SCENARIO...'"),
    ],
)
def test_exit_code_2_and_a_sentence_for_wrong_usage(cosim, arguments, text):
    result = cosim(*arguments)
    assert result.exit_code == 2
    assert text in result.stderr
    assert "Traceback" not in result.output


def refuse(scenario, controller):
    raise InputError([scenario.problem(("road", "track"), "no such track today")])


def break_network(scenario, controller):
    raise SensorError("default: it cannot be read as a network")


def test_a_later_check_reports_places(cosim):
    result = cosim("lap.yaml", assemble=refuse)
    assert result.exit_code == 2
    assert "error: lap.yaml:2:15: no such track today\n     2 | road:" in result.stderr


def test_exit_code_3_when_a_network_fails(cosim):
    result = cosim("lap.yaml", assemble=break_network)
    assert result.exit_code == 3
    assert result.stderr == "error: default: it cannot be read as a network\n"


@pytest.mark.parametrize(("name", "header"), [("csv", 1), ("parquet", 0)])
def test_exit_code_3_when_the_fmu_fails_and_the_record_until_then(cosim, name, header):
    result = cosim(
        "lap.yaml", "--set", f"output.format={name}", assemble=lambda *_: StandIn(fails_at=50)
    )
    assert result.exit_code == 3
    assert "the car has rolled over" in result.stderr
    file = Path(f"results/lap/signals.{name}")
    if header:
        assert len(file.read_text().splitlines()) == 50 + header
    else:
        import pyarrow.parquet as pq

        assert pq.read_table(file).num_rows == 50
    assert Path("results/lap/versions.json").exists()
    assert not Path("results/lap/metrics.json").exists()


def test_a_failed_run_leaves_nothing_of_an_earlier_one(cosim):
    cosim("lap.yaml")
    cosim("lap.yaml", assemble=refuse)
    assert [path.name for path in Path("results/lap").iterdir()] == ["scenario.resolved.yaml"]


def test_an_interrupted_run_says_so(cosim):
    def interrupt(*_):
        raise KeyboardInterrupt

    result = cosim("lap.yaml", assemble=interrupt)
    assert result.exit_code == 130
    assert "interrupted" in result.stderr


@pytest.mark.parametrize(("error", "code"), [(KeyboardInterrupt, 130), (SensorError, 3)])
def test_the_figures_of_runs_that_ended_outlive_a_later_one_s_failure(cosim, error, code):
    ended = []

    def second_fails(*_):
        if ended:
            raise error("no more")
        ended.append(StandIn())
        return ended[0]

    assert cosim("loop.yaml", assemble=second_fails).exit_code == code
    metrics = json.loads(Path("results/loop/metrics.json").read_text())
    assert list(metrics["runs"]) == ["passive"]
    assert metrics["runs"]["passive"]["simulated_s"] == 1.99
    assert Path("results/loop/report.html").exists()


def test_closed_loop_compares_the_controllers(cosim):
    result = cosim("loop.yaml")
    assert result.exit_code == 0, result.output
    assert "Controllers compared" in result.stderr
    assert "ISO 2631-1 weighted acceleration [m/s²]" in result.stderr
    assert {path.name for path in Path("results/loop").iterdir()} >= {"passive", "skyhook_truth"}
    metrics = json.loads(Path("results/loop/metrics.json").read_text())
    assert metrics["runs"]["skyhook_truth"]["controller"]["feedback"] == "truth"


def test_versions_tell_what_made_the_result(cosim):
    fmu = Path("vehicle.fmu")
    fmu.write_bytes(b"abc")
    cosim("lap.yaml", assemble=lambda *_: StandIn(files={"fmu": fmu}))
    versions = json.loads(Path("results/lap/versions.json").read_text())
    # SHA-256 of "abc": FIPS 180-4, example 1
    assert versions["files"]["fmu"]["sha256"].startswith("ba7816bf8f01cfea414140de5dae2223")
    assert versions["packages"]["numpy"]


def test_help_is_quick_and_needs_no_heavy_package():
    code = (
        "import sys, click.testing; from cosim.cli import main;"
        "print(click.testing.CliRunner().invoke(main, ['run', '--help']).output);"
        "print(sorted({'numpy', 'pydantic', 'rich', 'onnxruntime', 'pandas'} & set(sys.modules)))"
    )
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True,
        cwd=Path(__file__).parents[1],
    )  # fmt: skip
    assert time.perf_counter() - start < 5  # about 0.15 s alone on a desktop processor
    assert done.stdout.rstrip().endswith("[]")


def test_a_lap_that_is_not_finished_fails_without_a_limit(tmp_path, monkeypatch):
    """Nobody should take half a lap for a passed one."""
    (tmp_path / "a.yaml").write_text("name: a\nroad: {track: rural}\n")
    stuck = StandIn()
    finish = stuck.run
    stuck.run = lambda progress: replace(finish(progress), lap_time_s=None)
    monkeypatch.setattr("cosim.assembly.assemble", lambda *_: stuck)
    result = CliRunner().invoke(
        main, ["run", str(tmp_path / "a.yaml"), "--output-dir", str(tmp_path / "out")]
    )
    assert result.exit_code == 1
    assert "lap_time_s" in result.stderr
