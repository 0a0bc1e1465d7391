"""Events of the Open Simulation Platform's scenario format, beside libcosim's own execution."""

from __future__ import annotations

import json
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import foreign_masters
import numpy as np
import numpy.typing as npt
import pytest
from fault_rig import AZ, Array
from foreign_fmu import parrot
from loop_rig import write_scenario

from cosim.errors import InputError
from cosim.faults.assemble import fault_block
from cosim.results import resolved_yaml
from cosim.run import execute
from cosim.scenario.load import load
from sensor.channels import CHANNEL_NAMES

STEPS = 30
H = 0.01
NAMES = ("Car.ax", "Car.ay", "Car.vRR")

# An example of the format's own documentation (open-simulation-platform.github.io/libcosim),
# with variables of a car.
EXAMPLE = """\
description: as on the page
defaults:
  model: car
  variable: realOut
  action: override
events:
  - {time: 0.5, variable: realIn, action: bias, value: 1.001}
  - {time: 0.2, value: -1}
  - {time: 0.3, action: reset}
end: 1
"""


def by_libcosim(fmu: str, files: list[str]) -> list[list[list[float]]]:
    """Each file's run: the outputs `NAMES` after each step."""
    import fmpy
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.ERROR)
    variables = fmpy.read_model_description(fmu).modelVariables
    references = [v.valueReference for name in NAMES for v in variables if v.name == name]
    runs = []
    for file in files:
        execution = CosimExecution.from_step_size(H * 1e9)
        car = execution.add_local_slave(CosimLocalSlave(fmu, "car"))
        observer, manager = (
            CosimObserver.create_last_value(),
            CosimManipulator.create_scenario_manager(),
        )
        execution.add_observer(observer)
        execution.add_manipulator(manager)
        assert execution.load_scenario(manager, file)
        rows = []
        for _ in range(STEPS):
            assert execution.step()
            rows.append([float(v) for v in observer.last_real_values(car, references)])
        runs.append(rows)
    return runs


def by_us(folder: Path, file: Path, clean: Array) -> Array:
    fault = f"[{{kind: osp_scenario, file: {file.name}}}]"
    scenario = load(write_scenario(folder, sections={"faults": fault}))
    block = fault_block(scenario.acting_faults, 1)
    places = [CHANNEL_NAMES.index(name) for name in NAMES]
    channels = np.zeros((STEPS, 14))
    channels[:, places] = clean
    return np.array([block.step(k, row)[places] for k, row in enumerate(channels)])


def random_events(random: np.random.Generator) -> dict[str, Any]:
    """No two events fall on one step; some scenarios have no end, some an early one."""
    count = int(random.integers(1, 7))
    steps = random.choice(STEPS - 2, size=count, replace=False)
    events = []
    for step in steps:
        action = str(random.choice(["override", "bias", "reset"]))
        event = {"time": round(float(step) * H, 2), "action": action, "model": "car"}
        event["variable"] = str(random.choice(NAMES))
        if action != "reset":
            event["value"] = round(float(random.normal()), 3)
        events.append(event)
    scenario: dict[str, Any] = {"events": events}
    if random.random() < 0.7:
        scenario["end"] = round(float(random.integers(0, STEPS + 5)) * H, 2)
    return scenario


def test_the_channels_are_what_libcosim_makes_of_them(tmp_path: Path) -> None:
    """It acts before a step and reads after it: libcosim's row of step k is our sample k."""
    foreign_masters.available("libcosimpy")
    fmu = parrot(tmp_path / "p.fmu", version=2)
    random = np.random.default_rng(5)
    files = [tmp_path / f"{i}.json" for i in range(40)]
    files[0].write_text(json.dumps({"events": [{"time": 5.0, "model": "car", "action": "reset",
                                                "variable": "Car.ax"}]}))  # fmt: skip
    for file in files[1:]:
        file.write_text(json.dumps(random_events(random)))
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        theirs = np.array(pool.submit(by_libcosim, str(fmu), [str(f) for f in files]).result())
    clean = theirs[0]
    assert (theirs[1:] != clean).any(axis=(1, 2)).sum() > 30
    for file, expected in zip(files[1:], theirs[1:], strict=True):
        np.testing.assert_array_equal(by_us(tmp_path, file, clean), expected, err_msg=file.name)


def scenario_of(folder: Path, text: str, fault: str, ending: str = "yaml") -> Any:
    (folder / f"events.{ending}").write_text(text)
    faults = f"[{{kind: osp_scenario, file: events.{ending}, {fault}}}]"
    return load(write_scenario(folder, duration="1.2", sections={"faults": faults}))


MAPPED = "variables: {Car.az: {name: realOut, unit: g}, Car.vx: {name: realIn, scale: 2}}"


def changed(scenario: Any) -> npt.NDArray[np.float64]:
    block = fault_block(scenario.acting_faults, 1)
    return np.array([block.step(k, np.zeros(14)).copy() for k in range(120)])


def test_names_and_units_of_the_file_become_those_of_the_channels(tmp_path: Path) -> None:
    found = changed(scenario_of(tmp_path, EXAMPLE, MAPPED))
    expected = np.zeros((120, 14))
    expected[20:30, AZ] = -9.80665
    expected[50:100, CHANNEL_NAMES.index("Car.vx")] = 2.002
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_json_with_tabs_is_read_as_well(tmp_path: Path) -> None:
    events = [{"time": 0.2, "model": "car", "variable": "Car.az", "action": "bias", "value": 1.5}]
    text = json.dumps({"events": events, "end": 0.4}, indent="\t")
    found = changed(scenario_of(tmp_path, text, "name: gust", ending="json"))
    np.testing.assert_array_equal(found[:, AZ], np.where(np.arange(120) // 20 == 1, 1.5, 0.0))


def test_events_of_other_models_are_left_out_when_the_vehicle_is_named(tmp_path: Path) -> None:
    text = EXAMPLE + "# a second model\n"
    text = text.replace("end: 1", "  - {time: 0.1, model: crane, variable: load, value: 3}\nend: 1")
    found = changed(scenario_of(tmp_path, text, f"model: car, {MAPPED}"))
    assert not found[:20].any()
    with pytest.raises(InputError, match="of the models car, crane: say which of them is the veh"):
        scenario_of(tmp_path, text, MAPPED)
    with pytest.raises(InputError, match=r"no event is of the model 'cra'; did you mean 'crane'\?"):
        scenario_of(tmp_path, text, f"model: cra, {MAPPED}")


@pytest.mark.parametrize(
    ("old", "new", "message", "line"),
    [
        ("", "", "no channel stands for the variable 'realOut'", 8),
        ("realOut", "Car.azz", "variable 'Car.azz'.*did you mean 'Car.az'", 8),
        ("action: bias", "action: ramp", "events.0.action must be override, bias or reset", 7),
        ("time: 0.3", "time: 0.2", "a second event of realOut at 0.2 s", 9),
        (", value: -1", "", "the event has no value, which override needs", 8),
        ("  action: override\n", "", "the event has no action, and there is none under default", 7),
        ("value: -1", "value: true", "events.1.value must be a number, not true", 8),
        ("events:", "evnts:", "'evnts' is not a field of a file of events", 6),
        ("time: 0.3", "time: -0.3", "events.2.time must be at least 0 s, not -0.3 s", 9),
    ],
)  # fmt: skip
def test_a_mistake_is_shown_in_the_file_with_the_events(
    tmp_path: Path, old: str, new: str, message: str, line: int
) -> None:
    fault = "model: car" if "no channel" in message or "Car.az" in message else MAPPED
    with pytest.raises(InputError, match=message) as caught:
        scenario_of(tmp_path, EXAMPLE.replace(old, new, 1), fault)
    places = [p.place for p in caught.value.problems]
    assert all(place is not None and place.file.endswith("events.yaml") for place in places)
    assert line in [place.line for place in places if place is not None]


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ("evens.yaml", "no such OSP scenario file; did you mean '.*events.yaml'"),
        ("events.xml", "an OSP scenario is a .json, .yaml or .yml file, not"),
    ],
)
def test_a_file_that_is_not_there_is_told_at_its_name(
    tmp_path: Path, file: str, message: str
) -> None:
    (tmp_path / "events.yaml").write_text(EXAMPLE)
    path = write_scenario(tmp_path, sections={"faults": f"[{{kind: osp_scenario, file: {file}}}]"})
    with pytest.raises(InputError, match=message) as caught:
        load(path)
    assert caught.value.problems[0].place.line > 0


def test_a_unit_or_a_channel_that_does_not_fit_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'deg' is no unit for m/s2; write it as in '0\.5 m/s2'"):
        scenario_of(tmp_path, EXAMPLE, "variables: {Car.az: {name: realOut, unit: deg}}")
    with pytest.raises(InputError, match=r"'Car.aZZ' is no channel; did you mean 'Car.az'\?"):
        scenario_of(tmp_path, EXAMPLE, "variables: {Car.aZZ: {name: realOut}}")


def test_a_run_records_the_file_and_can_be_run_again(tmp_path: Path) -> None:
    scenario = scenario_of(tmp_path, EXAMPLE, f"name: events, {MAPPED}")
    outcome = execute(load(scenario.file, ["sensor.estimator=zero"]), tmp_path / "out")
    versions = json.loads((tmp_path / "out" / "versions.json").read_text())
    assert versions["files"]["fault events"]["path"].endswith("events.yaml")
    assert set(outcome.runs[0].figures["faults"]["events"]) == {"before", "during", "after"}
    (tmp_path / "else").mkdir()
    (tmp_path / "else" / "again.yaml").write_text(resolved_yaml(scenario))
    np.testing.assert_array_equal(
        changed(load(tmp_path / "else" / "again.yaml")), changed(scenario)
    )
