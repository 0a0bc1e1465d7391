"""Recipes of data sets: what is drawn for which run, and what is wrong with a recipe."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loop_rig import write_scenario

from cosim.dataset.draw import Draw, drawn_from
from cosim.dataset.plan import PlannedRun, check, plan
from cosim.dataset.recipe import Recipe, load_recipe
from cosim.errors import InputError
from cosim.scenario.load import load, load_with
from cosim.scenario.manoeuvre import ConstantRadius, SineWithDwell, Slalom
from cosim.scenario.obstacles import BumpRow
from cosim.scenario.schema import Scenario

DATASETS = Path(__file__).resolve().parent.parent / "scenarios" / "datasets"
RECIPE = """\
name: a few
seed: 3
runs:
  - scenarios: b_*.yaml
    dampers: [switching, passive]
  - scenarios: a_*.yaml
    dampers: [passive]
"""
DRAWN = """\
name: drawn
seed: 3
draw:
  damper_scale:
    one_of: [1, {log_uniform: [0.45, 1.8]}]
    times: {vehicle.parameters.Damp.ScaleFL: 1, vehicle.parameters.Damp.ScaleRL: 1.33}
runs:
  - scenarios: a.yaml
    dampers: [passive, fixed]
    count: 40
    draw:
      driver.speed_kmh: {uniform: [10, 130]}
      road.surface: [smooth, A, B]
      road.friction: 1
    cases:
      - {road.length_m: {whole: [100, 200]}}
      - {road.length_m: 500, vehicle.variants: [[payload], []]}
"""


def planned(folder: Path, text: str, *names: str) -> list[PlannedRun]:
    """Plan a recipe beside scenarios of these names."""
    for name in names:
        write_scenario(folder, name=name)
    (folder / "recipe.yaml").write_text(text)
    return plan(load_recipe(folder / "recipe.yaml"))


# ---------------------------------------------------------------- plan


def test_runs_are_in_the_order_of_the_recipe_then_of_the_names(tmp_path: Path) -> None:
    runs = planned(tmp_path, RECIPE, "b_2", "a_1", "b_10", "c_1")
    assert [run.stem for run in runs] == [
        "b_10_switching", "b_10_passive", "b_2_switching", "b_2_passive", "a_1_passive",
    ]  # fmt: skip
    assert [run.seed for run in runs] == [3000, 3001, 3002, 3003, 3004]
    assert all(load_with(run.scenario, run.overrides).seed == run.seed for run in runs)


def test_each_surface_is_a_run_of_its_own(tmp_path: Path) -> None:
    text = RECIPE.replace(
        "    dampers: [switching", "    surfaces: [A, smooth]\n    dampers: [switching"
    )
    runs = planned(tmp_path, text, "b_1", "a_1")
    assert [run.stem for run in runs[:4]] == [
        "b_1_class_a_switching",
        "b_1_class_a_passive",
        "b_1_smooth_switching",
        "b_1_smooth_passive",
    ]
    surfaces = [load_with(run.scenario, run.overrides).road.surface_name for run in runs]
    assert surfaces == ["A", "A", "smooth", "smooth", "smooth"]


def test_drawn_values_reach_the_scenario_and_stay_in_their_ranges(tmp_path: Path) -> None:
    runs = planned(tmp_path, DRAWN, "a")
    check(runs)
    assert len(runs) == 80
    assert [run.stem for run in runs[:2]] == ["a_passive_01", "a_passive_02"]
    scales = []
    for run in runs:
        scenario = load_with(run.scenario, run.overrides)
        assert scenario.driver.speed_kmh == run.drawn["driver.speed_kmh"]
        assert 10 <= run.drawn["driver.speed_kmh"] <= 130
        assert scenario.road.surface_name in ("smooth", "A", "B")
        assert scenario.road.friction == 1
        length = scenario.road.length_m
        assert length == 500 or ("vehicle.variants" not in run.drawn and 100 <= length <= 200)
        factor = run.drawn["damper_scale"]
        front, rear = (scenario.parameters[f"Damp.Scale{c}"] for c in ("FL", "RL"))
        assert (front, rear) == (factor, pytest.approx(1.33 * factor, rel=1e-5))
        scales.append(factor)
        assert ("command" in run.drawn) == (run.dampers == "fixed")
        json.dumps(dict(run.drawn))
    assert 20 < scales.count(1) < 60
    assert 0.45 <= min(scales) < 0.6 < 1.4 < max(scales) <= 1.8
    assert len({run.drawn["driver.speed_kmh"] for run in runs}) == len(runs)


def test_what_a_run_draws_depends_on_the_seed_and_its_number_alone(tmp_path: Path) -> None:
    runs = planned(tmp_path, DRAWN, "a")
    assert planned(tmp_path, DRAWN, "a") == runs
    fewer = planned(tmp_path, DRAWN.replace("count: 40", "count: 20"), "a")
    assert [run.drawn for run in fewer[:20]] == [run.drawn for run in runs[:20]]
    other = planned(tmp_path, DRAWN.replace("seed: 3", "seed: 4"), "a")
    assert all(a.drawn != b.drawn for a, b in zip(runs, other, strict=True))


def test_a_selection_draws_in_place_of_the_recipe(tmp_path: Path) -> None:
    text = DRAWN.replace("      road.friction: 1\n", "      damper_scale: {one_of: [9], times: "
                         "{vehicle.parameters.Damp.ScaleFL: 0.1}}\n")  # fmt: skip
    for run in planned(tmp_path, text, "a")[:5]:
        scenario = load_with(run.scenario, run.overrides)
        assert scenario.parameters == {"Damp.ScaleFL": 0.9} | {
            k: v for k, v in scenario.parameters.items() if k.startswith("Load.")
        }


@given(st.floats(1e-3, 1e3), st.floats(1.001, 1e3), st.integers(0, 2**32))
def test_draws_lie_between_their_ends(low: float, ratio: float, seed: int) -> None:
    high = low * ratio
    random = np.random.default_rng(seed)
    draws: Mapping[str, Draw] = {
        way: Draw.model_validate({way: (low, high)}) for way in ("uniform", "log_uniform")
    }
    for value in drawn_from(draws, random).values():
        assert low * (1 - 1e-5) <= value <= high * (1 + 1e-5)
        assert value == float(f"{value:.6g}")


def test_a_logarithmic_draw_is_as_often_below_the_geometric_mean_as_above() -> None:
    draw, random = Draw(log_uniform=(0.1, 10.0)), np.random.default_rng(1)
    values = np.array([draw.of(random) for _ in range(4000)])
    assert np.mean(values < 1.0) == pytest.approx(0.5, abs=0.03)
    whole = Draw(whole=(2, 4))
    assert {whole.of(random) for _ in range(100)} == {2, 3, 4}


# ---------------------------------------------------------------- mistakes

MISTAKES = [
    (RECIPE, "seed: 3", "sead: 3", ("recipe.yaml:2:1", "'sead'", "did you mean 'seed'", "no seed")),
    (RECIPE, "seed: 3", "seed: -1", ("recipe.yaml:2:7", "at least 0", "-1")),
    (RECIPE, "seed: 3", "seed: 1.5", ("recipe.yaml:2:7", "whole number")),
    (RECIPE, "seed: 3", "seed: 3\nseed: 4", ("recipe.yaml:3:1", "already given in line 2")),
    (RECIPE, "seed: 3", "seed: [", ("recipe.yaml:4:3", "not YAML")),
    (RECIPE, "[passive]", "[passiv]", ("recipe.yaml:7:15", "did you mean 'passive'")),
    (RECIPE, "[passive]", "[]", ("recipe.yaml:7:14", "must not be empty")),
    (RECIPE, "b_*.yaml", "''", ("recipe.yaml:4:16", "not empty")),
    (RECIPE, "b_*.yaml", "d_*.yaml", ("recipe.yaml:4:16", "matches 'd_*.yaml'")),
    (RECIPE, "b_*.yaml", "'[ab]_*.yaml'", ("recipe.yaml:6:16", "a_1_passive", "more than once")),
    (RECIPE, "name: a few\n", "", ("no name",)),
    (RECIPE, RECIPE, "", ("recipe.yaml", "empty", "name, seed and runs")),
    (RECIPE, RECIPE, "- one\n", ("recipe.yaml:1:1", "mapping")),
    (RECIPE, RECIPE, "name: a\nseed: 1\nruns: []\n", ("recipe.yaml:3:7", "must not be empty")),
    (DRAWN, "count: 40", "count: 0", ("recipe.yaml:10:12", "at least 1", "not 0")),
    (DRAWN, "count: 40", "count: 501", ("recipe.yaml", "1002 runs", "1000")),
    (DRAWN, "[10, 130]", "[130, 10]", ("recipe.yaml:12:25", "must go up", "130 to 10")),
    (DRAWN, "[10, 130]", "[10]", ("recipe.yaml:12", "runs.0.draw.driver.speed_kmh.uniform")),
    (DRAWN, "uniform: [10", "unform: [10", ("recipe.yaml:12:26", "did you mean 'uniform'")),
    (DRAWN, "[0.45, 1.8]", "[0, 1.8]", ("recipe.yaml:5:17", "greater than 0")),
    (DRAWN, "one_of: [1,", "one_of: [hard,", ("recipe.yaml:5:5", "times needs numbers")),
    (DRAWN, "      road.friction: 1", "      seed: 1", ("seed would be set twice",)),
    (DRAWN, "    count: 40", "    surfaces: [A]", ("road.surface would be set twice",)),
    (DRAWN, "road.friction: 1", "road.length_m: 90", ("road.length_m would be set twice",)),
]  # fmt: skip


@pytest.mark.parametrize(("text", "old", "new", "words"), MISTAKES)
def test_mistakes_in_a_recipe(
    tmp_path: Path, text: str, old: str, new: str, words: tuple[str, ...]
) -> None:
    assert old in text
    with pytest.raises(InputError) as caught:
        planned(tmp_path, text.replace(old, new), "a", "a_1", "b_1")
    message = str(caught.value)
    assert str(tmp_path / "recipe.yaml") in message
    assert all(word in message for word in words), message


SCENARIO_MISTAKES = [
    ("driver.speed_kmh", "driver.sped_kmh", ("'sped_kmh'", "did you mean 'speed_kmh'"), 12),
    ("[10, 130]", "[400, 500]", ("driver.speed_kmh must be at most 250 km/h",), 12),
    ("[smooth, A, B]", "[smooth, E]", ("road.surface must be smooth, A, B, C, D", "'E'"), 13),
    ("[[payload], []]", "[paylode]", ("'paylode' is no variant", "did you mean 'payload'"), 17),
]


@pytest.mark.parametrize(("old", "new", "words", "line"), SCENARIO_MISTAKES)
def test_what_a_scenario_refuses_is_shown_where_the_recipe_asks_for_it(
    tmp_path: Path, old: str, new: str, words: tuple[str, ...], line: int
) -> None:
    """Once, however many runs draw it."""
    assert old in DRAWN
    runs = planned(tmp_path, DRAWN.replace(old, new), "a")
    with pytest.raises(InputError) as caught:
        check(runs)
    problems = caught.value.problems
    assert len(problems) == 1
    assert str(problems[0]).startswith(f"{tmp_path / 'recipe.yaml'}:{line}:")
    assert all(word in str(problems[0]) for word in words)


def test_all_mistakes_of_a_recipe_at_once(tmp_path: Path) -> None:
    text = RECIPE.replace("seed: 3", "seed: -3\nsize: 4").replace("[passive]", "[odd]")
    with pytest.raises(InputError) as caught:
        planned(tmp_path, text)
    assert [problem.place and problem.place.line for problem in caught.value.problems] == [2, 3, 8]


def test_no_recipe(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone\.yaml: no such recipe file"):
        load_recipe(tmp_path / "gone.yaml")
    (tmp_path / "bytes.yaml").write_bytes(b"name: \xff\xfe\n")
    with pytest.raises(InputError, match=r"bytes\.yaml: byte 6 is not UTF-8"):
        load_recipe(tmp_path / "bytes.yaml")


# ---------------------------------------------------------------- the recipes of the project


Recipes = dict[str, tuple[Recipe, list[PlannedRun]]]
Training = list[tuple[PlannedRun, Scenario]]


@pytest.fixture(scope="module")
def recipes() -> dict[str, tuple[Recipe, list[PlannedRun]]]:
    found = {}
    for path in sorted(DATASETS.glob("*.yaml")):
        file = load_recipe(path)
        found[path.stem] = file.recipe, plan(file)
    return found


def test_no_seed_is_in_two_recipes_or_in_a_scenario(recipes: Recipes) -> None:
    """Surfaces, roads, mixes and dampers of the evaluation were never trained on."""
    assert set(recipes) == {"paper", "own", "harder", "evaluation", "hour"}
    seeds = [run.seed for _, runs in recipes.values() for run in runs]
    assert len(set(seeds)) == len(seeds)
    assert len({recipe.seed for recipe, _ in recipes.values()}) == len(recipes)
    scenarios = [load(p) for p in (DATASETS.parent / "paper").glob("*.yaml")]
    assert {scenario.seed for scenario in scenarios}.isdisjoint(seeds)


def test_the_recipe_of_the_published_network(recipes: Recipes) -> None:
    """The paper's split: Heilbronn and rural to train, Hockenheim to validate."""
    _, runs = recipes["paper"]
    assert len({run.stem for run in runs}) == len(runs) == 30
    assert {run.scenario.stem.split("_")[0] for run in runs} == {"heilbronn", "rural", "hockenheim"}
    assert all(run.dampers == "passive" for run in runs if "hockenheim" in run.stem)
    check(runs)


@pytest.fixture(scope="module")
def training(recipes: Recipes) -> Training:
    runs = [run for name in ("own", "harder") for run in recipes[name][1]]
    return [(run, load_with(run.scenario, run.overrides)) for run in runs]


def test_the_papers_testing_manoeuvres_are_never_trained_on(
    recipes: Recipes, training: Training
) -> None:
    """Nor is anything within 5 % of their radius, spacing, or angle at their speed."""
    tested = {path.name for path in (DATASETS.parent / "paper").glob("*.yaml")}
    laps = {name for name in tested if name.startswith(("heilbronn", "rural"))}
    for _, runs in (recipes["paper"], recipes["own"], recipes["harder"]):
        used = {run.scenario.name for run in runs if run.scenario.parent.name == "paper"}
        assert used <= laps | (
            {n for n in tested if "hockenheim" in n} if "1" in runs[0].stem else used
        )
    for run, scenario in training:
        assert scenario.road.track != "hockenheim"
        manoeuvre, kmh = scenario.manoeuvre, scenario.driver.speed_kmh
        if isinstance(manoeuvre, ConstantRadius):
            assert all(_apart(float(scenario.road.radius_m or 0), r) for r in (30, 60, 100)), run
        elif isinstance(manoeuvre, Slalom):
            assert _apart(manoeuvre.spacing_m, 18), run
        elif isinstance(manoeuvre, SineWithDwell):
            angle = all(_apart(manoeuvre.amplitude_deg, a) for a in (60, 80))
            assert angle or all(_apart(float(kmh or 0), v) for v in (40, 60, 80)), run
        for obstacle in scenario.road.obstacles:
            if isinstance(obstacle, BumpRow):
                assert _apart(obstacle.length_m, 1.3) or _apart(obstacle.spacing_m, 1.5), run


def _apart(value: float, other: float) -> bool:
    return abs(value - other) >= 0.045 * other


def test_the_projects_training_is_broad(training: Training) -> None:
    runs = training
    drawn: dict[str, list[Any]] = {}
    for run, scenario in runs:
        for name, value in run.drawn.items():
            drawn.setdefault(name, []).append(value)
        assert scenario.road.track in ("straight", "winding", "circle", "heilbronn", "rural")
    assert {run.dampers for run, _ in runs} == {"passive", "switching", "fixed", "skyhook"}
    assert {s.road.surface_name for _, s in runs} >= {"smooth", "A", "B", "C", "D"}
    assert max(drawn["load"]) > 400
    assert min(drawn["damper_scale"]) < 0.5
    assert max(drawn["damper_scale"]) > 1.7
    assert {*drawn["road.friction"]} >= {1, 0.4}
    for name in ("load", "damper_scale"):
        nominal = 0 if name == "load" else 1
        assert 0.4 < drawn[name].count(nominal) / len(runs) < 0.8
    straight = [s.driver.speed_kmh for r, s in runs if r.scenario.stem == "straight"]
    assert min(straight) < 25
    assert max(straight) > 110
