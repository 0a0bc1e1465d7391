"""Data sets: which runs a recipe means, and what driving one leaves on the disk."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from loop_rig import write_scenario

from cosim.assembly import assemble
from cosim.cli import main
from cosim.control.switching import SwitchingDampers
from cosim.dataset import NoSensor
from cosim.dataset.build import missing
from cosim.dataset.drive import drive
from cosim.dataset.plan import COMMAND, PlannedRun
from cosim.dataset.recipe import Dampers
from cosim.errors import InputError
from cosim.quantities import CORNERS
from cosim.scenario.load import load
from cosim.scenario.overrides import Override, split_key
from sensor.channels import CHANNELS, PASSIVE_COMMAND
from sensor.conditions import PRODUCTION_PARAMETERS
from sensor.dataset import Run, read_run

CLASS_B = "{kind: iso8608, class: B}"


def short(
    folder: Path, name: str = "a_short", duration: str = "lap", surface: str = CLASS_B,
    obstacles: str = "", controllers: str = "[{kind: passive}]", length_m: float = 25,
) -> Path:  # fmt: skip
    """Twenty-five metres, less than two seconds."""
    return write_scenario(
        folder,
        name=name,
        duration=duration,
        length_m=length_m,
        surface=surface,
        obstacles=obstacles,
        sections={"controllers": controllers},
    )


# ---------------------------------------------------------------- driving


def planned_run(scenario: Path, dampers: Dampers, seed: int, **more: Any) -> PlannedRun:
    """A run as a recipe without draws plans it."""
    fields = {"seed": seed, **more.pop("fields", {})}
    overrides = tuple(Override(split_key(k), v, "the recipe") for k, v in fields.items())
    return PlannedRun(f"{scenario.stem}_{dampers}", scenario, dampers, seed, overrides, **more)


def recorded(planned: PlannedRun, directory: Path) -> Run:
    directory.mkdir(exist_ok=True)
    assert drive(planned, directory) > 0.0
    return read_run(directory / f"{planned.stem}.parquet")


def test_a_run_is_what_the_loop_records(tmp_path: Path) -> None:
    """All rows of the lap, as the sensor's own reader takes them."""
    planned = planned_run(short(tmp_path), "passive", 5)
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
    run = recorded(planned_run(short(tmp_path), "passive", 5), tmp_path / "data")
    ideal = run.channels[:, [i for i, c in enumerate(CHANNELS) if "Steer" not in c.name]]
    assert run.stage.shape == ideal.shape
    assert not (run.stage == ideal).all(axis=0).any()
    np.testing.assert_allclose(run.stage[20:, 6:], ideal[20:, 6:], atol=0.1)  # speeds
    pitched = PRODUCTION_PARAMETERS["Sensor.Imu.Pitch"] * 9.81
    assert np.mean(run.stage[:, 0] - ideal[:, 0]) == pytest.approx(-pitched, abs=0.03)


def test_a_command_of_a_run_is_the_one_that_led_to_its_sample(tmp_path: Path) -> None:
    path = short(tmp_path)
    run = recorded(planned_run(path, "switching", 5), tmp_path / "data")
    scenario = load(path, ["seed=5"])
    again = assemble(scenario, scenario.controllers[0], NoSensor(), SwitchingDampers(5, 0.01))
    again.run(None)
    given = again.recorder.group("command").astype(np.float32)
    np.testing.assert_array_equal(run.commands[1:], given[:-1])
    np.testing.assert_array_equal(run.commands[0], 0.0)


def test_the_same_run_gives_the_same_bytes(tmp_path: Path) -> None:
    planned = planned_run(short(tmp_path), "switching", 5)
    files = []
    for folder in ("one", "two"):
        recorded(planned, tmp_path / folder)
        files.append((tmp_path / folder / "a_short_switching.parquet").read_bytes())
    assert files[0] == files[1]


def test_the_seed_is_that_of_the_surface(tmp_path: Path) -> None:
    path = short(tmp_path)
    truths = [recorded(planned_run(path, "passive", s), tmp_path / str(s)).truth for s in (5, 6)]
    assert not np.array_equal(truths[0], truths[1])


def test_dampers_that_switch_are_driven_and_noted(tmp_path: Path) -> None:
    path = short(
        tmp_path,
        surface="smooth",
        obstacles="{kind: bumps, height_m: 0.03, length_m: 0.5, spacing_m: 4}",
    )
    passive = recorded(planned_run(path, "passive", 5), tmp_path / "data")
    switching = recorded(planned_run(path, "switching", 5), tmp_path / "data")
    other = recorded(planned_run(path, "switching", 6), tmp_path / "other")
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
        recorded(planned_run(path, "passive", 5), tmp_path / "data")
        for path in (skyhook, short(tmp_path))
    ]
    np.testing.assert_array_equal(runs[0].truth, runs[1].truth)


def test_a_fixed_command_is_the_drawn_one(tmp_path: Path) -> None:
    run = recorded(planned_run(short(tmp_path), "fixed", 5, drawn={COMMAND: 0.75}), tmp_path / "d")
    np.testing.assert_array_equal(run.commands, np.float32(0.75))
    assert run.recipe["drawn"] == {COMMAND: 0.75}


def test_skyhook_acts_on_the_truth(tmp_path: Path) -> None:
    """Soft where damping would push the body on, so the commands reach both ends."""
    run = recorded(planned_run(short(tmp_path, length_m=40), "skyhook", 5), tmp_path / "data")
    assert run.commands.min() == 0.0
    assert run.commands.max() > 0.8


def test_drawn_values_are_driven(tmp_path: Path) -> None:
    """An even road is an even road: nothing of the scenario's own surface is left."""
    fields = {"road.surface": "smooth", "vehicle.parameters.Load.Mass": 300}
    planned = planned_run(short(tmp_path), "passive", 5, fields=fields)
    run = recorded(planned, tmp_path / "data")
    assert (run.road == 0.0).all()
    assert run.recipe["fields"] == {"seed": 5, **fields}


def test_a_given_time_of_a_lap_is_a_run(tmp_path: Path) -> None:
    run = recorded(planned_run(short(tmp_path, duration="0.5"), "passive", 1), tmp_path / "data")
    assert len(run.truth) == 51


def unreachable(folder: Path) -> Path:
    """With a hundredth of the accelerator the car cannot even keep its speed."""
    sections = {
        "manoeuvre": "{kind: accelerate, pedal: 0.01, to_kmh: 51, start_m: 0}",
        "road": "{track: straight, length_m: 300}",
    }
    return write_scenario(folder, name="b_weak", duration="lap", sections=sections)


def test_a_manoeuvre_that_is_not_finished_is_no_run(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"b_weak\.yaml: after .* s: manoeuvre not finished"):
        drive(planned_run(unreachable(tmp_path), "passive", 1), tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["b_weak.yaml"]


# ---------------------------------------------------------------- building


def test_runs_that_are_there_are_kept_and_outdated_ones_driven_again(tmp_path: Path) -> None:
    path, directory = short(tmp_path), tmp_path / "data"

    def built(*runs: PlannedRun) -> list[str]:
        left = missing(runs, directory)
        for run in left:
            recorded(run, directory)
        return [run.stem for run in left]

    passive, switching = planned_run(path, "passive", 1), planned_run(path, "switching", 2)
    assert built(passive) == ["a_short_passive"]
    assert built(passive, switching) == ["a_short_switching"]
    assert built(planned_run(path, "passive", 3), switching) == ["a_short_passive"]
    (directory / "a_short_switching.parquet").write_text("torn")
    assert built(switching) == ["a_short_switching"]
    whole = (directory / "a_short_switching.parquet").read_bytes()
    (directory / "a_short_switching.parquet").write_bytes(whole[: len(whole) // 2])
    assert built(switching) == ["a_short_switching"]
    assert (directory / "a_short_switching.parquet").read_bytes() == whole
    path.write_text(path.read_text() + "# another scenario\n")
    assert built(switching) == ["a_short_switching"]


def test_a_run_that_fails_is_named_and_the_others_are_written(tmp_path: Path) -> None:
    unreachable(tmp_path)
    short(tmp_path, "a_short")
    short(tmp_path, "c_short")
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text("name: x\nseed: 1\nruns: [{scenarios: '?_*.yaml', dampers: [passive]}]\n")
    command = ["sensor", "dataset", str(recipe), "--out", str(tmp_path / "data"), "--jobs", "1"]
    result = CliRunner().invoke(main, command)
    assert result.exit_code == 2
    assert "error: b_weak_passive: " in result.stderr
    assert "b_weak.yaml: after" in result.stderr
    assert "2 runs of" in result.stderr
    assert "1 FAILED" in result.stderr
    files = sorted(file.name for file in (tmp_path / "data").iterdir())
    assert files == ["a_short_passive.parquet", "c_short_passive.parquet"]
    unreachable(tmp_path).write_text((tmp_path / "a_short.yaml").read_text())
    result = CliRunner().invoke(main, command)
    assert result.exit_code == 0
    assert "[1/1] b_weak_passive\n" in result.stderr
    assert "2 were there" in result.stderr
    assert read_run(tmp_path / "data" / "b_weak_passive.parquet").recipe["seed"] == 1001


def test_the_command_shows_a_mistake_without_a_traceback(tmp_path: Path) -> None:
    path = tmp_path / "recipe.yaml"
    path.write_text("name: x\nseed: 1\nruns: [{scenarios: b_*.yaml, dampers: [passive]}]\n")
    command = ["sensor", "dataset", str(path), "--out", str(tmp_path / "data")]
    result = CliRunner().invoke(main, command)
    assert result.exit_code == 2
    assert "matches 'b_*.yaml'" in result.stderr
    assert "Traceback" not in result.output
    assert not (tmp_path / "data").exists()
