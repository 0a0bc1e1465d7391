"""Data sets: which runs a recipe means, and what driving one leaves on the disk."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from loop_rig import write_scenario

from cosim.assembly import assemble
from cosim.cli import main
from cosim.controller import SwitchingDampers
from cosim.dataset import (
    DatasetRecipe,
    NoSensor,
    PlannedRun,
    Selection,
    build,
    drive,
    drive_all,
    load_recipe,
    plan,
)  # fmt: skip
from cosim.errors import InputError
from cosim.quantities import CORNERS
from cosim.scenario.load import load
from sensor.channels import CHANNELS, PASSIVE_COMMAND
from sensor.conditions import PRODUCTION_PARAMETERS
from sensor.dataset import Run, read_run

ROOT = Path(__file__).resolve().parent.parent
RECIPE = """\
name: a few
seed: 3
runs:
  - scenarios: b_*.yaml
    dampers: [switching, passive]
  - scenarios: a_*.yaml
    dampers: [passive]
"""
CLASS_B = "{kind: iso8608, class: B}"


def short(
    folder: Path, name: str = "a_short", duration: str = "lap", surface: str = CLASS_B,
    obstacles: str = "", controllers: str = "[{kind: passive}]",
) -> Path:  # fmt: skip
    """Twenty-five metres, less than two seconds."""
    return write_scenario(
        folder,
        name=name,
        duration=duration,
        length_m=25,
        surface=surface,
        obstacles=obstacles,
        sections={"controllers": controllers},
    )


# ---------------------------------------------------------------- recipe and plan


def test_runs_are_in_the_order_of_the_recipe_then_of_the_names(tmp_path: Path) -> None:
    for name in ("b_2", "a_1", "b_10", "c_1"):
        (tmp_path / f"{name}.yaml").touch()
    (tmp_path / "recipe.yaml").write_text(RECIPE)
    runs = plan(load_recipe(tmp_path / "recipe.yaml"), tmp_path)
    assert [run.stem for run in runs] == [
        "b_10_switching", "b_10_passive", "b_2_switching", "b_2_passive", "a_1_passive",
    ]  # fmt: skip
    assert [run.seed for run in runs] == [3000, 3001, 3002, 3003, 3004]
    assert all(run.scenario.is_file() for run in runs)


def test_each_surface_is_a_run_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").touch()
    one = Selection(scenarios="a.yaml", surfaces=("A", "smooth"), dampers=("passive", "switching"))
    runs = plan(DatasetRecipe(name="surfaces", seed=0, runs=(one,)), tmp_path)
    assert [(run.stem, run.overrides) for run in runs] == [
        ("a_class_a_passive", ["seed=0", "road.surface=A"]),
        ("a_class_a_switching", ["seed=1", "road.surface=A"]),
        ("a_smooth_passive", ["seed=2", "road.surface=smooth"]),
        ("a_smooth_switching", ["seed=3", "road.surface=smooth"]),
    ]


def test_a_pattern_without_a_file(tmp_path: Path) -> None:
    (tmp_path / "b_1.yaml").touch()
    (tmp_path / "recipe.yaml").write_text(RECIPE)
    with pytest.raises(InputError, match=r"a_\*\.yaml"):
        plan(load_recipe(tmp_path / "recipe.yaml"), tmp_path)


def test_a_run_that_is_meant_twice(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").touch()
    twice = tuple(
        Selection(scenarios=pattern, dampers=("passive",)) for pattern in ("a*", "*.yaml")
    )
    recipe = DatasetRecipe(name="twice", seed=0, runs=twice)
    with pytest.raises(InputError, match="a_passive"):
        plan(recipe, tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("seed: 3", "sead: 3", ("sead", "seed")),
        ("seed: 3", "seed: -1", ("seed", "greater than or equal to 0")),
        ("seed: 3", "seed: 1.5", ("seed", "integer")),
        ("[passive]", "[passive, active]", ("runs.1.dampers.1", "'passive' or 'switching'")),
        ("[passive]", "[]", ("runs.1.dampers",)),
        ("    dampers: [passive]", "    surfaces: [E]\n    dampers: [passive]", ("surfaces.0",)),
        ("b_*.yaml", "''", ("runs.0.scenarios",)),
        ("name: a few\n", "", ("name",)),
        ("seed: 3", "seed: 3\nseed: 4", ("seed",)),
        ("seed: 3", "seed: [", ("recipe.yaml",)),
        (RECIPE, "", ("recipe.yaml",)),
        (RECIPE, "- one\n", ("recipe.yaml",)),
        (RECIPE, "name: a\nseed: 1\nruns: []\n", ("runs",)),
    ],
)
def test_mistakes_in_a_recipe(tmp_path: Path, old: str, new: str, words: tuple[str, ...]) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text(RECIPE.replace(old, new))
    with pytest.raises(InputError) as caught:
        load_recipe(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert all(word in message for word in words)


def test_all_mistakes_of_a_recipe_at_once(tmp_path: Path) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text(RECIPE.replace("seed: 3", "seed: -3\nsize: 4").replace("[passive]", "[odd]"))
    with pytest.raises(InputError) as caught:
        load_recipe(path)
    assert all(name in str(caught.value) for name in ("seed", "size", "dampers"))


def test_no_recipe(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone\.yaml: No such file"):
        load_recipe(tmp_path / "gone.yaml")


def test_a_recipe_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_bytes(b"name: \xff\xfe\n")
    with pytest.raises(InputError, match=r"recipe\.yaml"):
        load_recipe(path)


def test_the_recipe_of_the_published_network() -> None:
    """Every run has a file and a seed of its own, whatever machine drives it."""
    file = ROOT / "scenarios" / "datasets" / "paper.yaml"
    runs = plan(load_recipe(file), file.parent)
    assert len({run.stem for run in runs}) == len({run.seed for run in runs}) == len(runs)
    assert {run.scenario.stem.split("_")[0] for run in runs} == {"heilbronn", "rural", "hockenheim"}
    assert all(run.dampers == "passive" for run in runs if "hockenheim" in run.stem)
    assert all(load(run.scenario, run.overrides).duration == "lap" for run in runs)
    assert len(runs) == 30
    assert {run.surface for run in runs} == {"A", "smooth"}


# ---------------------------------------------------------------- driving


def recorded(planned: PlannedRun, directory: Path) -> Run:
    directory.mkdir(exist_ok=True)
    assert drive(planned, directory) == planned.stem
    return read_run(directory / f"{planned.stem}.parquet")


def test_a_run_is_what_the_loop_records(tmp_path: Path) -> None:
    """All rows of the lap, as the sensor's own reader takes them."""
    planned = PlannedRun(short(tmp_path), "passive", 5)
    run = recorded(planned, tmp_path / "data")
    scenario = load(planned.scenario, ["seed=5"])
    again = assemble(scenario, scenario.controllers[0], NoSensor())
    result = again.run(None)
    assert result.lap_time_s is not None
    for values, group in ((run.channels, "channels"), (run.truth, "truth")):
        np.testing.assert_array_equal(values, again.recorder.group(group).astype(np.float32))
    assert (run.commands == np.float32(PASSIVE_COMMAND)).all()
    heights = again.recorder.columns([f"Car.zRoad{c}" for c in CORNERS])
    np.testing.assert_array_equal(run.road, heights.astype(np.float32))
    assert 1e-4 < np.abs(run.road).max() < 0.1
    assert (
        run.recipe.items() >= {"scenario": "a_short.yaml", "dampers": "passive", "seed": 5}.items()
    )
    assert run.name == "a_short_passive"
    assert [path.name for path in (tmp_path / "data").iterdir()] == ["a_short_passive.parquet"]


def test_production_sensors_are_recorded_as_they_are_mounted(tmp_path: Path) -> None:
    """Turned, moved and slowed, but the same motion; without the settings it is that of the car."""
    run = recorded(PlannedRun(short(tmp_path), "passive", 5), tmp_path / "data")
    ideal = run.channels[:, [i for i, c in enumerate(CHANNELS) if "Steer" not in c.name]]
    assert run.stage.shape == ideal.shape
    assert not (run.stage == ideal).all(axis=0).any()
    np.testing.assert_allclose(run.stage[20:, 6:], ideal[20:, 6:], atol=0.1)  # speeds
    pitched = PRODUCTION_PARAMETERS["Sensor.Imu.Pitch"] * 9.81
    assert np.mean(run.stage[:, 0] - ideal[:, 0]) == pytest.approx(-pitched, abs=0.03)


def test_a_command_of_a_run_is_the_one_that_led_to_its_sample(tmp_path: Path) -> None:
    path = short(tmp_path)
    run = recorded(PlannedRun(path, "switching", 5), tmp_path / "data")
    scenario = load(path, ["seed=5"])
    again = assemble(scenario, scenario.controllers[0], NoSensor(), SwitchingDampers(5, 0.01))
    again.run(None)
    given = again.recorder.group("command").astype(np.float32)
    np.testing.assert_array_equal(run.commands[1:], given[:-1])
    np.testing.assert_array_equal(run.commands[0], 0.0)


def test_the_same_run_gives_the_same_bytes(tmp_path: Path) -> None:
    planned = PlannedRun(short(tmp_path), "switching", 5)
    files = []
    for folder in ("one", "two"):
        recorded(planned, tmp_path / folder)
        files.append((tmp_path / folder / "a_short_switching.parquet").read_bytes())
    assert files[0] == files[1]


def test_the_seed_is_that_of_the_surface(tmp_path: Path) -> None:
    path = short(tmp_path)
    truths = [recorded(PlannedRun(path, "passive", s), tmp_path / str(s)).truth for s in (5, 6)]
    assert not np.array_equal(truths[0], truths[1])


def test_dampers_that_switch_are_driven_and_noted(tmp_path: Path) -> None:
    path = short(
        tmp_path,
        surface="smooth",
        obstacles="{kind: bumps, height_m: 0.03, length_m: 0.5, spacing_m: 4}",
    )
    passive = recorded(PlannedRun(path, "passive", 5), tmp_path / "data")
    switching = recorded(PlannedRun(path, "switching", 5), tmp_path / "data")
    other = recorded(PlannedRun(path, "switching", 6), tmp_path / "other")
    assert switching.recipe["dampers"] == "switching"
    rms = [float(np.sqrt(np.mean(run.truth**2))) for run in (passive, switching, other)]
    assert len(set(rms)) == 3  # a smooth seedless surface: only the dampers differ
    scenario = load(path, ["seed=5"])
    again = assemble(scenario, scenario.controllers[0], NoSensor(), SwitchingDampers(5, 0.01))
    again.run(None)
    command = again.recorder.group("command")
    assert all(len(np.unique(column)) > 1 for column in command.T)
    np.testing.assert_array_equal(switching.truth, again.recorder.group("truth").astype(np.float32))


def test_passive_means_passive_whatever_the_scenario_controls(tmp_path: Path) -> None:
    skyhook = short(tmp_path, "skyhook", controllers="[{kind: skyhook, feedback: truth}]")
    runs = [
        recorded(PlannedRun(path, "passive", 5), tmp_path / "data")
        for path in (skyhook, short(tmp_path))
    ]
    np.testing.assert_array_equal(runs[0].truth, runs[1].truth)


def test_a_lap_that_is_not_finished_is_no_run(tmp_path: Path) -> None:
    path = short(tmp_path, duration="0.5")
    with pytest.raises(InputError, match=r"a_short\.yaml: the lap was not finished"):
        drive(PlannedRun(path, "passive", 1), tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["a_short.yaml"]


def test_runs_that_are_there_are_kept_and_outdated_ones_driven_again(tmp_path: Path) -> None:
    path, directory = short(tmp_path), tmp_path / "new" / "data"

    def built(*runs: PlannedRun) -> list[str]:
        told: list[str] = []
        with ThreadPoolExecutor(1) as executor:
            build(list(runs), directory, executor, told.append)
        return told

    passive, switching = PlannedRun(path, "passive", 1), PlannedRun(path, "switching", 2)
    assert built(passive) == ["a_short_passive"]
    assert built(passive, switching) == ["a_short_switching"]
    assert built(PlannedRun(path, "passive", 3), switching) == ["a_short_passive"]
    (directory / "a_short_switching.parquet").write_text("torn")
    assert built(switching) == ["a_short_switching"]
    path.write_text(path.read_text() + "# another scenario\n")
    assert built(switching) == ["a_short_switching"]
    assert len(read_run(directory / "a_short_switching.parquet").truth) > 100


def test_processes_of_their_own(tmp_path: Path) -> None:
    """What the first one drove stays, and the second one's mistake arrives as it was."""
    short(tmp_path, "a_short")
    short(tmp_path, "b_long", duration="0.5")
    runs = "runs: [{scenarios: '?_*.yaml', dampers: [passive]}]"
    (tmp_path / "recipe.yaml").write_text(f"name: two\nseed: 1\n{runs}\n")
    told: list[str] = []
    with pytest.raises(InputError, match=r"b_long\.yaml: the lap was not finished"):
        drive_all(tmp_path / "recipe.yaml", tmp_path / "data", 1, told.append)
    assert told == ["a_short_passive"]
    assert read_run(tmp_path / "data" / "a_short_passive.parquet").recipe["seed"] == 1000


def test_the_command_shows_a_mistake_without_a_traceback(tmp_path: Path) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text(RECIPE)
    result = CliRunner().invoke(main, ["dataset", str(path), "--out", str(tmp_path / "data")])
    assert result.exit_code == 2
    assert "matches 'b_*.yaml'" in result.stderr
    assert "Traceback" not in result.output
