"""Several scenarios in one command: real runs in real processes (cosim.batch)."""

from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from foreign_fmu import Variable, own_variables, parrot
from loop_rig import write_scenario

from cosim.batch import Ended, Job, find_scenarios, plan, run_all
from cosim.batch.job import RunEnd
from cosim.cli import main
from cosim.errors import InputError
from cosim.tables import batch_table

TIMES = ("wall_time_s", "real_time_factor", "timing")  # of metrics.json: how long the machine took
PASSES = "[{metric: largest_deviation_m, max: 1}]"
FAILS = "[{metric: sensor.overall.rmse_m_s, max: 1e-9}]"
OF_ALL = "[{metric: fixed.simulated_s, min: 1}, {signal: time, max: 1}]"
CLOSED_LOOP = "[{kind: passive}, {kind: skyhook, feedback: truth}]"


def cosim(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["run", *arguments])


def bare(metrics: dict[str, Any]) -> dict[str, Any]:
    """metrics.json without the times that the runs took."""
    for run in metrics["runs"].values():
        for name in TIMES:
            del run[name]
    return metrics


@dataclass(frozen=True)
class Batch:
    folder: Path
    result: Result

    def ended(self) -> dict[str, dict[str, Any]]:
        return {Path(one["scenario"]).stem: one for one in json.loads(self.result.stdout)}


@pytest.fixture(scope="module")
def batch(tmp_path_factory: pytest.TempPathFactory) -> Batch:
    """Three that end well or with a failed limit, one whose FMU fails with words, two whose FMU
    takes its process down, one of them in the second of three runs, and a YAML file that is no
    scenario.
    """
    folder = tmp_path_factory.mktemp("batch")
    below = folder / "set" / "more"
    below.mkdir(parents=True)
    rough = {"limits": PASSES, "seed": "7"}
    write_scenario(folder / "set", name="good", surface="C", sections=rough)
    write_scenario(folder / "set", name="bad_limit", surface="A", sections={"limits": FAILS})
    write_scenario(below, name="closed", surface="B", sections={"controllers": CLOSED_LOOP})
    far = Variable("Far", 400_000_000, "parameter", start=0.0)  # not the parrot's own memory
    parrot(below / "p.fmu", (*own_variables().values(), far))
    words = "{Parrot.FailAt: 20, Parrot.FailStatus: 3, Parrot.FailWords: 1}"
    for name, parameters in (("words", words), ("dies", "{Far: 1}")):
        vehicle = f"{{fmu: p.fmu, parameters: {parameters}}}"
        write_scenario(below, name=name, sections={"vehicle": vehicle})
    aborts = "{fmu: p.fmu, parameters: {Parrot.AbortAt: 57, Parrot.OnlySoft: 1}}"
    fixed = "[{kind: passive}, {kind: fixed, command: 0}, {kind: fixed, command: 1, name: hard}]"
    sections = {"vehicle": aborts, "controllers": fixed, "limits": OF_ALL}
    write_scenario(below, name="aborts", sections=sections)
    (folder / "set" / "recipe.yaml").write_text("runs: []\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        result = cosim("set", "--jobs", "2", "--json", "--set", "driver.style=aggressive")
    return Batch(folder, result)


def test_each_ends_in_its_own_way_and_the_worst_decides(batch: Batch) -> None:
    codes = {name: one["exit_code"] for name, one in batch.ended().items()}
    assert codes == {
        "good": 0, "bad_limit": 1, "closed": 0, "words": 3, "dies": 3, "aborts": 3,
    }  # fmt: skip
    assert batch.result.exit_code == 3


def test_failures_are_said_in_a_sentence(batch: Batch) -> None:
    said = batch.result.stderr
    assert "error: set/more/words.yaml: p.fmu: could not step at t = 0.19 s: the parrot" in said
    assert "error: set/more/dies.yaml: the run crashed (SIGSEGV, memory that is not its" in said
    assert ") before its start\n" in said
    assert "set/recipe.yaml has no road, so it is no scenario; left out" in said
    assert "4 of 6 scenarios FAILED; results in results" in said
    assert "Traceback" not in said


def test_progress_counts_and_the_table_has_a_row_per_run(batch: Batch) -> None:
    said = batch.result.stderr
    assert all(f"[{n}/6] set/" in said for n in range(1, 7))
    rows = [line.split() for line in said.splitlines() if line.startswith("  set/")]
    assert [(row[0], row[1]) for row in rows] == [
        ("set/bad_limit.yaml", "FAILED"),
        ("set/good.yaml", "passed"),
        ("set/more/aborts.yaml", "(passive)"),
        ("set/more/aborts.yaml", "(fixed)"),
        ("set/more/aborts.yaml", "(hard)"),
        ("set/more/closed.yaml", "(passive)"),
        ("set/more/closed.yaml", "(skyhook_truth)"),
        ("set/more/dies.yaml", "error"),
        ("set/more/words.yaml", "error"),
    ]


def test_every_scenario_has_its_files(batch: Batch) -> None:
    results = batch.folder / "results"
    assert {path.name for path in results.iterdir()} == {
        "good", "bad_limit", "closed", "words", "dies", "aborts",
    }  # fmt: skip
    assert (results / "good" / "report.html").exists()
    assert (results / "closed" / "skyhook_truth" / "signals.csv").exists()
    # the rows before the FMU failed, t = 0 included
    assert len((results / "words" / "signals.csv").read_text().splitlines()) == 1 + 20
    versions = json.loads((results / "good" / "versions.json").read_text())
    assert versions["command"] == "cosim run set/good.yaml --set driver.style=aggressive"


def test_a_run_that_crashes_leaves_its_rows_and_the_other_runs(batch: Batch) -> None:
    """The FMU aborts in the step from t = 0.56 s, before which row 56 was recorded."""
    results, said = batch.folder / "results" / "aborts", batch.result.stderr
    sentence = (
        r"error: set/more/aborts\.yaml: the run fixed crashed \(SIGABRT, it gave up\) inside "
        r"an FMU, in \w+ \(fmi\.py, line \d+\) after the sample at t = 0\.56 s; it printed: "
        r"parrot\.c: assertion failed: it is only resting; the 57 samples until then are in "
        r"results/aborts/fixed/signals\.csv\n"
    )
    assert re.search(sentence, said)
    rows = {
        name: (results / name / "signals.csv").read_text().splitlines()
        for name in ("passive", "fixed", "hard")
    }
    assert {name: len(lines) for name, lines in rows.items()} == {
        "passive": 1 + 101, "fixed": 1 + 57, "hard": 1 + 101,
    }  # fmt: skip
    assert rows["fixed"][-1].startswith("0.56")
    assert rows["fixed"][0] == rows["passive"][0]
    metrics = json.loads((results / "metrics.json").read_text())
    assert list(metrics["runs"]) == ["passive", "hard"]
    assert [(v["run"], v["passed"]) for v in metrics["limits"]] == [
        ("passive", True),
        ("hard", True),
    ]
    assert (results / "report.html").exists()
    assert not list(batch.folder.rglob("*.part"))


@pytest.mark.parametrize("name", ["good", "closed"])
def test_a_scenario_alone_gives_the_same_bits(
    batch: Batch, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(batch.folder)
    (file,) = Path("set").rglob(f"{name}.yaml")
    alone = cosim(str(file), "--output-dir", f"alone/{name}", "--set", "driver.style=aggressive")
    assert alone.exit_code == 0, alone.output
    together = Path("results") / name
    files = [path.relative_to(together) for path in together.rglob("signals.csv")]
    assert files
    for path in (*files, Path("scenario.resolved.yaml")):
        assert (Path("alone") / name / path).read_bytes() == (together / path).read_bytes()
    figures = [
        bare(json.loads((folder / "metrics.json").read_text()))
        for folder in (Path("alone") / name, together)
    ]
    assert figures[0] == figures[1] == bare(batch.ended()[name]["metrics"])


def test_problems_of_all_come_before_the_first_step_of_any(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_scenario(tmp_path, name="fine")
    write_scenario(tmp_path, name="misspelt", sections={"driver": "{sped_kmh: 3}"})
    write_scenario(tmp_path, name="late", sections={"vehicle": "{parameters: {Bdy.Mass: 1}}"})
    (tmp_path / "torn.yaml").write_text("name: [a\n")
    result = cosim(".", "--jobs", "2", "--json")
    assert result.exit_code == 2
    assert "error: misspelt.yaml:4:10: 'sped_kmh' is not a field of driver" in result.stderr
    assert "error: late.yaml:5:" in result.stderr
    assert "error: torn.yaml:" in result.stderr
    assert not Path("results").exists()
    assert [one["exit_code"] for one in json.loads(result.stdout)] == [0, 2, 2, 2]


def test_a_wrong_override_is_said_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b"):
        write_scenario(tmp_path, name=name)
    result = cosim(".", "--jobs", "1", "--set", "road.surfce=A")
    assert result.exit_code == 2
    assert result.stderr.count("'surfce' is not a field of road; did you mean 'surface'?") == 1
    assert "did you mean 'b.yaml'?" in cosim("bb.yaml").stderr
    (tmp_path / "road").mkdir()
    assert "did you mean 'road'?" in cosim("roda").stderr


# ---------------------------------------------------------------- without processes


def test_a_folder_stands_for_the_scenarios_below_it(tmp_path: Path) -> None:
    inner = tmp_path / "b"
    inner.mkdir()
    first, second = write_scenario(tmp_path, name="z"), write_scenario(inner, name="a")
    (tmp_path / "other.yaml").write_text("a: 1\n")
    (tmp_path / "torn.yaml").write_text("a: [\n")
    (tmp_path / "notes.txt").write_text("road: x\n")
    (inner / "scenario.resolved.yaml").write_text("road: x\n")  # among the results of a run
    found, others = find_scenarios([tmp_path, first])
    assert found == [second, tmp_path / "torn.yaml", first]
    assert others == [tmp_path / "other.yaml"]
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(InputError, match="there is no scenario in the folder"):
        find_scenarios([empty])


def test_two_scenarios_must_not_share_a_folder(tmp_path: Path) -> None:
    files = [tmp_path / "x" / "a.yaml", tmp_path / "y" / "a.yaml", tmp_path / "b.yaml"]
    with pytest.raises(InputError, match=r"would both write to '.*a'; rename one"):
        plan(files, tmp_path / "results")
    jobs = plan(
        files[1:], tmp_path / "results", [("a=1", "--set a=1"), ("duration=3", "--duration 3")]
    )
    assert [job.output_dir.name for job in jobs] == ["a", "b"]
    assert jobs[1].command == f"cosim run {tmp_path / 'b.yaml'} --set a=1 --duration 3"


def test_the_table_tells_passed_failed_and_no_limits() -> None:
    def ended(name: str, *passed: bool) -> Ended:
        limits = [{"run": "passive", "passed": one} for one in passed]
        metrics = {"runs": {"passive": {"simulated_s": 3.0}}, "limits": limits}
        return Ended(Job(Path(name), Path()), metrics=metrics, runs=(RunEnd("passive", {}),))

    died = Ended(Job(Path("d"), Path()), 3, runs=(RunEnd("passive", exit_code=3),))
    unfit = Ended(Job(Path("e"), Path()), 3)
    table = batch_table([ended("a", True), ended("b", True, False), ended("c"), died, unfit])
    assert [row[1] for row in table.rows] == ["passed", "FAILED", "no limits", "error", "error"]
    assert table.rows[0][2:4] == ("3.0", "-")


def test_threads_are_the_same_in_every_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else sums of a run alone could come out in another order than in a batch."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    assert cosim("gone.yaml").exit_code == 2
    assert os.environ["OPENBLAS_NUM_THREADS"] == "1"


def test_a_scenario_that_is_gone_is_no_crash(tmp_path: Path) -> None:
    """It was there when the files were looked for."""
    job = Job(tmp_path / "gone.yaml", tmp_path / "results")
    ended, were_run = run_all([job], 1)
    assert not were_run
    assert ended == [Ended(job, 2, ended[0].problems)]
    assert "no such scenario file" in ended[0].problems[0]
