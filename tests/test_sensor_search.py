import json
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import optuna
import pytest
from click.testing import CliRunner
from optuna.trial import Trial, TrialState
from search_rig import bowl, hanging, make_recipe, measured_bowl, open_all, slow_bowl, start
from test_sensor_training import TRAINING, VALIDATION

from cosim.cli import main
from sensor.dataset import write_run
from sensor.errors import SensorError
from sensor.recipe import RECIPES, EarlyStop, read_search_recipe
from sensor.search.durations import Shape, durations
from sensor.search.study import finished, work
from sensor.search.surface import fit_surface
from sensor.search.trial import WindowObjective, falls_behind


def do(recipe: Any, folder: Path, objective: Callable[[Trial], float]) -> list[Any]:
    """Do the missing trials; return all, by window and number, as (window, shape, value)."""
    folder.mkdir(exist_ok=True)
    studies = open_all(recipe, folder)
    work(recipe, studies, dict.fromkeys(studies, objective))
    return [
        (window, trial.params, trial.value)
        for window, study in studies.items()
        for trial in finished(study)
    ]


def test_the_gaussian_process_finds_the_minimum_better_than_chance(tmp_path: Path) -> None:
    recipe = make_recipe(windows=[3, 5, 7], trials=12, startup=4)
    trials = do(recipe, tmp_path, measured_bowl)
    reached = median(min(v for w, _, v in trials if w == window) for window in recipe.windows)
    drawn = bowl(*np.random.default_rng(0).integers(1, 16, (2, 4000, 12))).min(axis=1)
    assert reached < np.quantile(drawn, 0.1)


def test_an_interrupted_search_ends_in_the_same_trials(tmp_path: Path) -> None:
    recipe, calls = make_recipe(), 0

    def interrupted(trial: Trial) -> float:
        nonlocal calls
        calls += 1
        if calls in (3, 6, 9):
            raise KeyboardInterrupt
        return measured_bowl(trial)

    whole = do(recipe, tmp_path / "whole", measured_bowl)
    for _ in range(3):
        with pytest.raises(KeyboardInterrupt):
            do(recipe, tmp_path / "parts", interrupted)
    assert do(recipe, tmp_path / "parts", interrupted) == whole
    assert len(whole) == 12
    assert do(make_recipe(seed=2), tmp_path / "other", measured_bowl) != whole
    # A longer search goes on from there; one of another kind does not.
    longer = do(make_recipe(trials=7), tmp_path / "parts", measured_bowl)
    assert [trial for trial in longer if trial in whole] == whole
    assert len(longer) == 14
    with pytest.raises(SensorError, match="begun with another recipe"):
        open_all(make_recipe(seed=2), tmp_path / "parts")


def test_processes_share_the_studies(tmp_path: Path) -> None:
    recipe = make_recipe()
    open_all(recipe, tmp_path)
    helpers = [start(tmp_path, slow_bowl) for _ in range(2)]
    for helper in helpers:
        helper.join(300)
        assert helper.exitcode == 0
    for study in open_all(recipe, tmp_path).values():
        trials = finished(study)
        assert len(trials) == recipe.trials
        assert len({tuple(trial.params.values()) for trial in trials[: recipe.startup]}) == 3
        assert {trial.user_attrs["process"] for trial in trials} == {h.pid for h in helpers}


def test_the_trial_of_a_killed_process_is_done_again(tmp_path: Path) -> None:
    recipe = make_recipe()
    studies = open_all(recipe, tmp_path)
    helper = start(tmp_path, hanging)
    deadline = time.monotonic() + 300
    while len(finished(studies[5])) < 1:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    time.sleep(0.5)  # it hangs in its second trial of the first window
    helper.kill()
    helper.join()
    assert len(do(recipe, tmp_path, measured_bowl)) == 12
    states = [trial.state for study in studies.values() for trial in study.get_trials()]
    assert states.count(TrialState.FAIL) == 1


def test_a_trial_that_falls_behind_stops_and_counts(tmp_path: Path) -> None:
    recipe = make_recipe(windows=[5], stop={"after": 2, "behind": 0.0})
    study = open_all(recipe, tmp_path)[5]
    said: list[str] = []
    objective = WindowObjective(recipe, 5, (TRAINING, VALIDATION), said.append)
    work(recipe, {5: study}, {5: objective})
    trials = finished(study)
    assert len(trials) == len(said) == 6
    for trial in trials:
        assert trial.value == min(trial.intermediate_values.values())
        assert trial.user_attrs["epochs"] == len(trial.intermediate_values)
    assert {2, 3} == {trial.user_attrs["epochs"] for trial in trials}


def test_falling_behind_is_measured_at_the_same_epoch() -> None:
    study = optuna.create_study()
    for value in (1.0, 2.0, 4.0):
        course = {1: 10.0 * value, 2: value}
        study.add_trial(optuna.trial.create_trial(value=value, intermediate_values=course))
    stop = EarlyStop(after=2, behind=0.1)
    assert falls_behind(stop, study, 2, 2.3)
    assert not falls_behind(stop, study, 2, 2.1)
    assert not falls_behind(stop, study, 1, 100.0)
    assert not falls_behind(None, study, 2, 100.0)


def test_the_surface_passes_through_what_was_measured() -> None:
    rng = np.random.default_rng(1)
    shapes = rng.integers(1, 16, (25, 2)).astype(float)
    rmse = bowl(*shapes.T) + rng.normal(scale=1e-4, size=25)
    surface = fit_surface(shapes, rmse, np.array([2.0, 6.0, 9.0, 14.0]))
    expected = bowl(surface.units[:, np.newaxis], surface.hidden)
    np.testing.assert_allclose(surface.mean, expected, rtol=0.0, atol=1e-3)
    few = shapes[:, 0] < 7  # of a large part it knows nothing, and says so
    partial = fit_surface(shapes[few], rmse[few], surface.units)
    assert partial.std[3].min() > 3.0 * partial.std[1].max()


def test_a_longer_window_takes_longer() -> None:
    times = durations([Shape(3, 256, 64), Shape(51, 256, 64), Shape(3, 256, 64)], samples=40)
    assert times[1] > 2.0 * max(times[0], times[2])
    assert times[2] == pytest.approx(times[0], rel=1.0)


@pytest.mark.parametrize("name", ["search", "search_full"])
def test_the_recipes_search_what_the_paper_searched(name: str) -> None:
    recipe = read_search_recipe(RECIPES / f"{name}.yaml")
    assert recipe.windows == (3, 7, 11, 17, 19, 21, 25, 31, 51)
    for span in (recipe.units, recipe.hidden):
        assert (span.least, span.most) == (1, 512)
    assert not any("hockenheim" in pattern for pattern in recipe.runs.training)


def test_the_command_searches_and_writes_the_table(tmp_path: Path) -> None:
    for run in (*TRAINING, *VALIDATION):
        write_run(tmp_path / f"{run.name}.parquet", run)
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(make_recipe(trials=3, startup=3).model_dump_json())
    arguments = ["sensor", "search", str(recipe), "--data", str(tmp_path), "--out", str(tmp_path)]
    result = CliRunner().invoke(main, [*arguments, "--summary"])
    assert result.exit_code == 2
    assert "there is no search" in result.output
    result = CliRunner().invoke(main, [*arguments, "--samples", "5"])
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "search.json").read_text())
    assert [row["window"] for row in found["windows"]] == [3, 5]
    for row in found["windows"]:
        assert len(row["trials"]) == 3
        best = min(row["trials"], key=lambda trial: trial["rmse"])
        assert (best["units"], best["hidden"], best["rmse"]) == (
            row["units"], row["hidden"], row["rmse"],
        )  # fmt: skip
        shape = (len(row["surface"]["units"]), len(row["surface"]["hidden"]))
        assert np.shape(row["surface"]["mean"]) == np.shape(row["surface"]["std"]) == shape
    assert found["windows"][0]["relative_error_percent"] == 100.0
    assert [row["window"] for row in found["paper_shapes"]] == [3, 7, 11, 17, 19, 21, 25, 31, 51]
    before = (tmp_path / "studies.sqlite3").stat().st_mtime_ns
    again = CliRunner().invoke(main, [*arguments, "--summary", "--samples", "5"])
    assert again.exit_code == 0
    assert (tmp_path / "studies.sqlite3").stat().st_mtime_ns == before
