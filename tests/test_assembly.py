"""From a scenario to blocks: parameters, roads, networks, and what is wrong with them, in place."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foreign_fmu import ECHO, Variable, own_variables, parrot
from loop_rig import Blind, Guess, write_scenario

from cosim.assembly import Assembly, assemble
from cosim.control.fixed import FixedDampers
from cosim.errors import InputError, NetworkError
from cosim.metrics import COMFORT_FIGURES
from cosim.record import record_groups
from cosim.road import Smooth, build_road, load_track
from cosim.scenario.load import load
from sensor.channels import PASSIVE_COMMAND

SHORT = "0.05"


def assembled(
    folder: Path, duration: str, sections: dict[str, str], length_m: float = 150
) -> Assembly:
    path = write_scenario(folder, duration=duration, length_m=length_m, sections=sections)
    scenario = load(path)
    return assemble(scenario, scenario.controllers[0], sensor=Blind())


def build(folder: Path, duration: str = SHORT, **sections: str) -> Assembly:
    """The blocks of a short run, its FMU already freed."""
    built = assembled(folder, duration, sections)
    built.blocks.vehicle.stop()
    return built


def complaints(folder: Path, **sections: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        assembled(folder, SHORT, sections)
    return [str(problem) for problem in caught.value.problems]


def driven(folder: Path, duration: str = SHORT, length_m: float = 150, **sections: str) -> Assembly:
    built = assembled(folder, duration, sections, length_m)
    built.run(None)
    return built


# ---------------------------------------------------------------- parameters


@pytest.mark.parametrize(
    ("parameter", "sentence"),
    [
        ("Bdy.Mass: 2000", "has no parameter 'Bdy.Mass'; did you mean 'Body.Mass'?"),
        ("Body.Mass: 400", "Body.Mass = 400 kg is below its least value 500 kg"),
        ("Body.Mass: 2e4", "Body.Mass = 20000 kg is above its greatest value 10000 kg"),
        ("PT.RearShare: 1.01", "PT.RearShare = 1.01 is above its greatest value 1"),
        ("Body.Mass: heavy", "Body.Mass = 'heavy' must be a number"),
        ("Body.Mass: true", "Body.Mass = true must be a number"),
        ("SlipControl.Active: 1", "SlipControl.Active = 1.0 must be true or false"),
        ("Car.ax: 1", "has no parameter 'Car.ax'"),
        ("Road.File: road.crg", "'Road.File' is set by road; use that"),
        ("Init.Velocity: 3", "'Init.Velocity' is set by driver.speed_kmh; use that"),
        ("Damp.Passive: true", "'Damp.Passive' is set by controllers; use that"),
        ("Road.Friction: 0.4", "'Road.Friction' is set by road.friction; use that"),
    ],
)
def test_a_parameter_that_does_not_fit(tmp_path: Path, parameter: str, sentence: str) -> None:
    (complaint,) = complaints(tmp_path, vehicle=f"{{parameters: {{{parameter}}}}}")
    assert sentence in complaint
    assert complaint.startswith(f"{tmp_path / 'scenario.yaml'}:5:")


def test_every_parameter_that_does_not_fit(tmp_path: Path) -> None:
    vehicle = "{parameters: {Body.Mass: 1, Brake.Lag: 0, Tire.Radiu: 0.3}}"
    assert len(complaints(tmp_path, vehicle=vehicle)) == 3


def test_parameters_at_the_ends_of_their_range_reach_the_fmu(tmp_path: Path) -> None:
    vehicle = "{parameters: {Brake.FrontShare: 0, PT.RearShare: 1, Aero.Drag: 0}}"
    free = driven(tmp_path, "1", vehicle=vehicle, driver="{speed_kmh: 120}")
    plain = driven(tmp_path, "1", driver="{speed_kmh: 120}")
    speed = [run.recorder.group("channels")[-1, 6] for run in (free, plain)]
    assert speed[0] > speed[1] + 0.05  # the driver reckons with a drag that is not there


def test_the_friction_of_the_road_reaches_the_tyres_and_lasts(tmp_path: Path) -> None:
    """With the same pedal the car brakes as hard as the friction lets it, to the end."""
    rates = {}
    for friction in (0.1, 1.0):
        sections = {
            "road": f"{{track: straight, friction: {friction}}}",
            "driver": "{speed_kmh: 30}",
            "manoeuvre": "{kind: brake, pedal: 0.9}",
        }
        rates[friction] = assembled(tmp_path, "lap", sections).run(None).manoeuvre
    assert 0.3 < rates[0.1]["mean_deceleration_m_s2"] < 0.1 * 11.0
    assert 7.0 < rates[1.0]["mean_deceleration_m_s2"] < 11.0
    assert rates[0.1]["distance_m"] > 7 * rates[1.0]["distance_m"]


def test_another_fmu_without_an_input_for_friction(tmp_path: Path) -> None:
    parrot(tmp_path / "p.fmu", tuple(own_variables().values()))
    (complaint,) = complaints(
        tmp_path, road="{track: straight, length_m: 150, friction: 0.4}", vehicle="{fmu: p.fmu}"
    )
    assert "scenario.yaml:3:" in complaint
    assert "'p.fmu' has no input 'Road.Friction' for the road's friction" in complaint


@pytest.mark.parametrize(
    ("obstacle", "sentence"),
    [
        ("{kind: hump, at_m: 149, height_m: 0.1, length_m: 2}", "hump ends at 151 m, behind the"),
        ("{kind: hump, at_m: 50, height_m: 0.1, length_m: 0.1}", "is too short for the road's gr"),
        (
            "{kind: bumps, height_m: 0.1, length_m: 1, spacing_m: 3, to_m: 15}",
            "no room for a bump of 1 m between 15 m and 15 m",
        ),
    ],
)
def test_every_obstacle_that_does_not_fit_is_shown_in_place(
    tmp_path: Path, obstacle: str, sentence: str
) -> None:
    path = write_scenario(tmp_path, obstacles=f"{obstacle}, {obstacle}")
    scenario = load(path)
    with pytest.raises(InputError) as caught:
        assemble(scenario, scenario.controllers[0], sensor=Blind())
    found = [str(problem) for problem in caught.value.problems]
    assert len(found) == 2
    assert all("scenario.yaml:3:" in one and sentence in one for one in found)


def test_an_input_that_the_loop_writes_is_no_parameter(tmp_path: Path) -> None:
    assert complaints(tmp_path, vehicle="{parameters: {DM.Gas: 0.5}}")


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        pytest.param("Int32", "1.5", id="no whole number"),
        pytest.param("Int64", "1", id="a type that is not supported"),
    ],
)
def test_parameters_of_another_fmu(tmp_path: Path, kind: str, value: str) -> None:
    odd = Variable("Odd", 450, "parameter", type=kind, start=1)
    parrot(tmp_path / "p.fmu", (*own_variables().values(), odd))
    vehicle = f"{{fmu: p.fmu, parameters: {{Odd: {value}}}}}"
    (complaint,) = complaints(tmp_path, vehicle=vehicle)
    assert "Odd" in complaint


def test_another_fmu_may_have_names_that_are_taken_here(tmp_path: Path) -> None:
    odd = Variable("Init.x", 450, "parameter", start=1)
    parrot(tmp_path / "p.fmu", (*own_variables().values(), odd))
    built = build(tmp_path, vehicle="{fmu: p.fmu, parameters: {Init.x: 3}}")
    assert built.files["fmu"] == tmp_path / "p.fmu"


def test_limits_of_another_fmu(tmp_path: Path) -> None:
    odd = replace(Variable("Odd", 450, "parameter", "m/s"), start=1.0, limits=(0.5, 2.0))
    parrot(tmp_path / "p.fmu", (*own_variables().values(), odd))
    (complaint,) = complaints(tmp_path, vehicle="{fmu: p.fmu, parameters: {Odd: 3}}")
    assert "Odd = 3 m/s is above its greatest value 2 m/s" in complaint


# ---------------------------------------------------------------- start, road, end


def test_the_car_starts_on_the_track_at_the_profiles_speed(tmp_path: Path) -> None:
    car = driven(tmp_path, driver="{speed_kmh: 36}")
    x, y, yaw = car.recorder.group("vehicle")[0, :3]
    assert (x, y, yaw) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert car.recorder.group("channels")[0, 6] == pytest.approx(10.0)


def test_a_road_without_a_speed_limit_needs_one(tmp_path: Path) -> None:
    (complaint,) = complaints(tmp_path, driver="{style: normal}")
    assert "scenario.yaml:4:1: the straight road has no speed limit" in complaint
    assert "driver.speed_kmh" in complaint


def test_a_road_file_that_is_none_is_shown_in_place(tmp_path: Path) -> None:
    (tmp_path / "r.crg").write_text("no road\n")
    path = tmp_path / "scenario.yaml"
    path.write_text("name: a\nduration: 1\nroad: {file: r.crg}\n")
    scenario = load(path)
    with pytest.raises(InputError, match=r"scenario\.yaml:3:14: .*r\.crg"):
        assemble(scenario, scenario.controllers[0], sensor=Blind())


def test_the_run_ends_with_the_road(tmp_path: Path) -> None:
    scenario = load(write_scenario(tmp_path, duration="lap", length_m=30))
    built = assemble(scenario, scenario.controllers[0], sensor=Blind())
    result = built.run(None)
    assert result.finish_reason == "end of the road"
    assert result.lap_time_s == result.simulated_s == built.recorder.time[-1]
    assert result.lap_time_s == pytest.approx(30 / (50 / 3.6), abs=0.05)
    assert built.recorder.rows == result.steps_done + 1
    x = built.recorder.group("vehicle")[:, 0]
    assert x[-1] >= 30.0 > x[-2]
    assert result.largest_deviation_m < 0.05


def test_the_run_ends_with_the_duration(tmp_path: Path) -> None:
    scenario = load(write_scenario(tmp_path, duration="0.5"))
    built = assemble(scenario, scenario.controllers[0], sensor=Blind())
    result = built.run(None)
    assert (result.lap_time_s, result.finish_reason) == (None, "duration reached")
    assert (result.steps_done, result.simulated_s) == (50, 0.5)
    assert result.wall_time_s > 0


def test_a_lap_that_is_given_up_says_so(tmp_path: Path) -> None:
    """A parrot does not get anywhere: its x is its steering-wheel angle."""
    parrot(tmp_path / "p.fmu", (*own_variables().values(), Variable("Echo", ECHO)))
    vehicle = "{fmu: p.fmu, variables: {Car.tx: {name: Echo}}}"
    scenario = load(
        write_scenario(tmp_path, duration="lap", length_m=20, sections={"vehicle": vehicle})
    )
    result = assemble(scenario, scenario.controllers[0], sensor=Blind()).run(None)
    assert result.lap_time_s is None
    assert "duration" not in result.finish_reason


def test_a_duration_beyond_the_road_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the road ends after about"):
        driven(tmp_path, "1e15", length_m=20)


def test_a_road_file_of_the_users_own(tmp_path: Path) -> None:
    """The car starts as far behind its beginning as it needs to stand on it, and drives it all."""
    track = load_track("straight", 60.0)
    build_road(track, Smooth(), tmp_path).rename(tmp_path / "own.crg")
    path = tmp_path / "scenario.yaml"
    path.write_text("name: a\nroad: {file: own.crg}\ndriver: {speed_kmh: 50}\n")
    scenario = load(path)
    built = assemble(scenario, scenario.controllers[0], sensor=Blind())
    result = built.run(None)
    assert result.finish_reason == "end of the road"
    assert built.files["road"] == (tmp_path / "own.crg").resolve()
    assert result.largest_deviation_m < 0.05
    x = built.recorder.group("vehicle")[:, 0]
    assert x[0] == pytest.approx(0.0, abs=0.1)
    assert 60.0 < x[-1] < track.s[-1]


def test_comfort_leaves_the_start_out(tmp_path: Path) -> None:
    """There are figures from two seconds on after the first two."""
    bumps = "{kind: bumps, height_m: 0.02, length_m: 0.5, spacing_m: 5}"
    scenario = load(write_scenario(tmp_path, duration="4.5", obstacles=bumps))
    figures = assemble(scenario, scenario.controllers[0], sensor=Blind()).run(None).comfort
    assert set(figures) == set(COMFORT_FIGURES)
    assert all(value > 0 for value in figures.values())
    scenario = load(write_scenario(tmp_path, duration="3.9", obstacles=bumps))
    assert not assemble(scenario, scenario.controllers[0], sensor=Blind()).run(None).comfort


# ---------------------------------------------------------------- controllers and networks


def test_passive_dampers_are_the_fmus_own_curve(tmp_path: Path) -> None:
    """Not the soft end of the semi-active ones, which command 0 would be."""
    bumps = "{kind: bumps, height_m: 0.02, length_m: 0.5, spacing_m: 5}"
    scenario = load(write_scenario(tmp_path, duration="2", obstacles=bumps))
    runs = []
    for dampers in (None, FixedDampers(0.0)):
        built = assemble(scenario, scenario.controllers[0], Blind(), dampers)
        built.run(None)
        expected = PASSIVE_COMMAND if dampers is None else 0.0
        np.testing.assert_array_equal(built.recorder.group("command"), expected)
        np.testing.assert_array_equal(built.initial_command, expected)
        runs.append(np.std(built.recorder.group("truth")))
    assert runs[1] > 1.1 * runs[0]


def test_skyhook_starts_with_its_initial_command(tmp_path: Path) -> None:
    controllers = "[{kind: skyhook, feedback: estimate, initial_command: 0.3}]"
    scenario = load(write_scenario(tmp_path, duration="0.5", sections={"controllers": controllers}))
    built = assemble(scenario, scenario.controllers[0], sensor=Guess())
    built.run(None)
    np.testing.assert_array_equal(built.recorder.group("command")[:18], 0.3)
    assert (built.recorder.group("command")[18:] != 0.3).any()


def test_a_network_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "n.onnx").write_text("no network")
    scenario = load(write_scenario(tmp_path, sections={"sensor": "{network: n.onnx}"}))
    with pytest.raises(NetworkError, match=r"n\.onnx"):
        assemble(scenario, scenario.controllers[0])


def test_an_installation_without_a_network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sensor.estimators.MODELS", tmp_path)
    scenario = load(write_scenario(tmp_path))
    with pytest.raises(NetworkError, match="'carried' is not shipped for condition ideal"):
        assemble(scenario, scenario.controllers[0])


def test_files_that_decide_the_result_are_named(tmp_path: Path) -> None:
    files = build(tmp_path).files
    assert set(files) == {"fmu", "road"}
    assert all(path.is_file() for path in files.values())


def test_the_record_names_every_column_once_with_its_unit() -> None:
    signals = [signal for _, group in record_groups() for signal in group]
    names = [signal.name for signal in signals]
    assert len(set(names)) == len(names)
    assert [name for name, _ in record_groups()] == [
        "channels", "estimate", "deviation", "valid", "truth", "command", "driver", "vehicle",
        "ideal", "measured", "held",
    ]  # fmt: skip
    assert {s.name: s.header for s in signals}["Car.CFL.q0"] == "Car.CFL.q0 [m]"
    assert {s.name: s.header for s in signals}["DM.Gas"] == "DM.Gas"
