"""Evaluation on recorded runs: what counts, and that kept figures are those made anew."""

import json
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner

from cosim.cli import main
from cosim.errors import InputError
from cosim.evaluation.command import read_before
from cosim.evaluation.evaluate import Content, evaluate_all
from cosim.evaluation.overview import overview
from cosim.evaluation.plan import Plan, plan
from sensor import CHANNELS, OUTPUTS, SensorError, evaluate
from sensor.baselines import StillWheels
from sensor.channels import COMMANDS, ROAD, STAGE
from sensor.dataset import Run, read_run, write_run
from sensor.evaluation import WARM_UP, Estimate, evaluate_run, figures, measured_channels
from sensor.fingerprint import fingerprint, sources
from sensor.metrics import THETA0

Array = npt.NDArray[np.float64]
PAIRS = (("ideal", "zero"), ("ideal", "body_motion"), ("production", "body_motion"))
SPEED = 20.0


def make_run(name: str, seed: int, samples: int = 400) -> Run:
    """A car at 20 m/s: its body heaves by random accelerations, its wheels keep their height."""
    random = np.random.default_rng(seed)
    channels = np.zeros((samples, len(CHANNELS)))
    channels[:, 2] = random.normal(size=samples)
    channels[:, 6] = SPEED
    channels[:, 9:13] = SPEED
    commands = np.full((samples, len(COMMANDS)), 0.3)
    truth = StillWheels().apply(channels, commands) + 0.01 * random.normal(size=(samples, 4))
    truth[:WARM_UP] = 1e3  # what happens in the warm-up must not count
    stage = np.zeros((samples, len(STAGE)))
    stage[:, :6], stage[:, 6:] = channels[:, :6], SPEED
    parts = (channels, stage, commands, truth, np.zeros((samples, len(ROAD))))
    assert truth.shape[1] == len(OUTPUTS)
    return Run(name, *(part.astype(np.float32) for part in parts), recipe={"seed": seed})


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    for seed, name in enumerate(("mix_a_passive_1", "mix_a_passive_2")):
        write_run(folder / f"{name}.parquet", make_run(name, seed, 400 + 50 * seed))
    return folder


def test_record_of_a_run(runs: Path) -> None:
    path = runs / "mix_a_passive_1.parquet"
    record = evaluate_run(path, PAIRS)
    assert record["samples"] == 400 - WARM_UP
    assert record["recipe"] == {"seed": 0}
    assert {name: list(found) for name, found in record["figures"].items()} == {
        "ideal": ["zero", "body_motion"], "production": ["body_motion"],
    }  # fmt: skip
    run = read_run(path)
    truth = run.truth[WARM_UP:].astype(np.float64)
    zero, still = (record["figures"]["ideal"][name] for name in ("zero", "body_motion"))
    assert zero["overall"]["rmse"] == pytest.approx(np.sqrt(np.mean(truth**2)))
    assert zero["overall"]["accuracy"] == 0.0
    assert still["overall"]["rmse"] == pytest.approx(0.01, rel=0.05)
    assert still["modes"]["heave"]["accuracy"] > still["modes"]["warp"]["accuracy"]
    target = zero["projected"]
    assert target["truth_rms"] ** 2 == pytest.approx(np.mean((truth + SPEED * np.sin(THETA0)) ** 2))
    assert target["rmse"] == pytest.approx(zero["overall"]["rmse"])  # the speed is known exactly
    assert still["coverage"] is None
    json.dumps(record, allow_nan=False)


def test_production_noise_is_the_runs_own(runs: Path) -> None:
    first, second = (read_run(path) for path in sorted(runs.glob("*.parquet")))
    measured = measured_channels(first, "production")
    np.testing.assert_array_equal(measured, measured_channels(first, "production"))
    np.testing.assert_array_equal(measured_channels(first, "ideal"), first.channels)
    assert not np.array_equal(measured[:, 2], measured_channels(second, "production")[:400, 2])


def test_coverage_is_told_where_a_deviation_is_offered() -> None:
    run = make_run("x", 1)
    velocities = run.truth.astype(np.float64) + 0.02
    one = Estimate(velocities, np.full(velocities.shape, [0.01, 0.0121, 0.0122, 0.05]))
    speed = run.channels[:, 6].astype(np.float64)
    share = figures(run, one, speed)["coverage"]
    assert list(share.values()) == [0.0, 0.0, 100.0, 100.0]  # 0.02 / 1.645 is 0.01216
    assert list(share) == [channel.name for channel in OUTPUTS]


def test_what_cannot_be_evaluated_is_refused(tmp_path: Path) -> None:
    write_run(tmp_path / "short.parquet", make_run("short", 1, WARM_UP))
    with pytest.raises(SensorError, match="100 samples are not more than 100"):
        evaluate_run(tmp_path / "short.parquet", PAIRS)
    with pytest.raises(InputError) as caught:
        plan(tmp_path / "none", ["zeru"], ["perfect", "prodution"])
    words = str(caught.value)
    for part in ("no run (*.parquet)", "'zeru'; did you mean 'zero'?", "'perfect'", "'production'"):
        assert part in words


def evaluated(
    chosen: Plan, before: Content | None = None, processes: int = 1, told: list[str] | None = None
) -> Content:
    saved: list[Content] = []
    tell = [].append if told is None else told.append
    evaluate_all(chosen, before, processes, tell, saved.append)
    (content,) = saved
    return content


def test_kept_figures_are_those_made_anew(runs: Path) -> None:
    chosen = plan(runs, ["zero", "body_motion"], None)
    told: list[str] = []
    whole = evaluated(chosen, None, 2, told)
    assert (
        sorted(told)
        == ["mix_a_passive_1", "mix_a_passive_2"]
        == [run["name"] for run in whole["runs"]]
    )
    only_zero = evaluated(plan(runs, ["zero"], None))
    assert evaluated(chosen, only_zero) == whole
    # Nothing is left to do, so nobody notices a figure that was changed by hand.
    changed = json.loads(json.dumps(whole))
    changed["runs"][0]["figures"]["ideal"]["zero"]["overall"]["rmse"] = 7.0
    again = evaluated(chosen, changed)
    assert again["runs"][0]["figures"]["ideal"]["zero"]["overall"]["rmse"] == 7.0
    # But a run, or an estimator, that is another one is evaluated anew.
    other_run = json.loads(json.dumps(changed))
    other_run["runs"][0]["sha256"] = "another"
    assert evaluated(chosen, other_run) == whole
    other_estimator = Plan(
        chosen.files,
        chosen.estimators,
        {
            pair: "another" if pair[1] == "zero" else one
            for pair, one in chosen.fingerprints.items()
        },
    )
    anew = evaluated(other_estimator, changed)
    assert anew["runs"] == whole["runs"]


def test_broken_off_work_keeps_the_runs_that_are_done(runs: Path) -> None:
    saved: list[Content] = []

    def interrupt(name: str) -> None:
        raise KeyboardInterrupt

    chosen = plan(runs, ["zero", "body_motion"], None)
    with pytest.raises(KeyboardInterrupt):
        evaluate_all(chosen, None, 1, interrupt, saved.append)
    (content,) = saved
    assert [run["name"] for run in content["runs"]] == ["mix_a_passive_2"]  # the longer one
    assert evaluated(chosen, content) == evaluated(chosen)


def test_overview_pools_all_runs(runs: Path) -> None:
    table = overview(evaluated(plan(runs, ["zero", "body_motion"], ["ideal"])))
    assert table.title.startswith(f"2 runs pooled, {850 - 2 * WARM_UP} samples")
    truth = np.concatenate(
        [read_run(path).truth[WARM_UP:] for path in sorted(runs.glob("*.parquet"))]
    )
    expected = evaluate(np.zeros(truth.shape), truth.astype(np.float64)).overall.rmse
    zero, still = table.rows
    assert zero[:4] == ("zero", "ideal", f"{expected:.4f}", "0.0")
    assert still[-1] == "-"


def test_an_unreadable_or_other_file_keeps_nothing(tmp_path: Path) -> None:
    file = tmp_path / "figures.json"
    assert read_before(file) is None
    for text in ("{", "[]", '{"runs": []}'):
        file.write_text(text)
        assert read_before(file) is None


def test_fingerprints_tell_estimators_and_conditions_apart() -> None:
    found = {
        fingerprint(name, condition)
        for name in ("zero", "body_motion", "bilstm_w19")
        for condition in ("ideal", "production")
    }
    assert len(found) == 6
    assert fingerprint("zero", "ideal") == fingerprint("zero", "ideal")
    with pytest.raises(SensorError, match="no estimator"):
        fingerprint("zeru", "ideal")


def test_a_fingerprint_covers_what_the_estimator_imports_and_no_other() -> None:
    """A change of the training, or of another estimator, spoils no figures."""
    kalman, zero = sources("kalman_imu", "ideal"), sources("zero", "ideal")
    assert {"sensor.kalman.filter", "sensor.evaluation", "sensor.metrics.modes"} <= kalman.keys()
    assert not [name for name in kalman if "carried" in name or "training" in name]
    assert kalman.keys() - zero.keys() > {"sensor.kalman.filter", "sensor.kalman.delay"}
    assert all(path.is_file() for path in kalman.values())


def test_command(runs: Path, tmp_path: Path) -> None:
    out = tmp_path / "build" / "figures.json"
    arguments = ["sensor", "evaluate", "--data", str(runs), "--out", str(out), "--jobs", "1"]
    result = CliRunner().invoke(main, [*arguments, "--estimators", "zero,body_motion"])
    assert result.exit_code == 0, result.output
    assert "2 runs; figures in" in result.output
    content = json.loads(out.read_text(encoding="utf-8"))
    assert content["estimators"] == ["zero", "body_motion"]
    assert content["conditions"] == ["ideal", "production"]
    assert content == evaluated(plan(runs, ["zero", "body_motion"], None))
    before = out.stat().st_mtime_ns
    wrong = ["--estimators", "zero, body_moton", "--conditions", "nominal"]
    result = CliRunner().invoke(main, [*arguments, *wrong])
    assert result.exit_code == 2
    assert "--estimators: there is no estimator 'body_moton'; did you mean" in result.output
    assert "--conditions: there is no condition 'nominal'" in result.output
    assert out.stat().st_mtime_ns == before


def test_command_names_a_run_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "broken.parquet").write_text("no Parquet")
    arguments = ["sensor", "evaluate", "--data", str(tmp_path), "--out", str(tmp_path / "f.json")]
    result = CliRunner().invoke(main, [*arguments, "--estimators", "zero", "--jobs", "1"])
    assert result.exit_code == 2
    assert "broken.parquet: it cannot be read as a Parquet file" in result.output
