"""A scenario's FMUs, their wiring, their start values and its commands as one file, SSP 1.0."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from cosim.assembly import assemble, checked_parts, start_values
from cosim.errors import InputError, NetworkError
from cosim.fmi import Description, Value
from cosim.quantities import DAMPERS
from cosim.scenario.controllers import Passive
from cosim.sensor import estimator_file
from cosim.ssp.archive import fmu_with, zipped
from cosim.ssp.documents import PARAMETERS, parameter_values, system_structure
from cosim.ssp.recording import RECORDING, Recording, record
from cosim.ssp.structure import SENSOR, VEHICLE, Structure, structure_of
from cosim.start import OWN_ROAD, ROAD_FILE
from cosim.wiring import Wiring
from sensor.errors import SensorError

if TYPE_CHECKING:
    from cosim.scenario.controllers import Controller
    from cosim.scenario.schema import Scenario

FMI: Final = 2  # of the package's own FMUs: what masters that read SSP 1.0 know


@dataclass(frozen=True)
class Package:
    """An SSP: its bytes, what is connected in it, and the direct run whose commands it holds."""

    content: bytes
    structure: Structure
    run: Recording


def export(
    scenario: Scenario,
    controller: Controller,
    progress: Callable[[int, int], None] | None = None,
    components_only: bool = False,
) -> Package:
    """Run the scenario with one of its controllers and return the package, if asked so without the
    system's own connectors.

    Raises `InputError` with everything wrong in the scenario or beyond what an SSP can hold,
    `FmuError` or `NetworkError` for a file that does not load, and what a run raises.
    """
    scenario = _to_record(scenario)
    wiring, vehicle, course, plan = checked_parts(scenario)
    network = _network(scenario, controller)
    values = start_values(scenario, vehicle, course, plan, isinstance(controller, Passive))
    assembly = assemble(scenario, controller)
    values |= _initial_inputs(wiring, float(assembly.initial_command[0]))
    with tempfile.TemporaryDirectory() as folder:
        fmu = _sensor_fmu(network, Path(folder))
        structure = structure_of(
            scenario.name, scenario.description, wiring, vehicle, Description(fmu)
        )
        sensor_content = fmu.read_bytes()
    if components_only:
        structure = structure.components_only()
    road = course.file.read_bytes() if ROAD_FILE in values else None
    content = vehicle.path.read_bytes()
    if road is not None:
        content = fmu_with(vehicle.path, f"resources/{OWN_ROAD}", road)
        values[ROAD_FILE] = "" if scenario.vehicle.fmu == "builtin" else OWN_ROAD
    run = record(assembly, progress)
    contents = {
        "SystemStructure.ssd": system_structure(structure, run.stop_s),
        PARAMETERS: _values(scenario.name, vehicle, values, structure),
        f"resources/{VEHICLE}.fmu": content,
        f"resources/{SENSOR}.fmu": sensor_content,
        RECORDING: run.csv(),
    }
    return Package(zipped(contents), structure, run)


def _to_record(scenario: Scenario) -> Scenario:
    """Return the scenario at full speed, with the package's vehicle FMU as an SSP holds it."""
    vehicle = scenario.vehicle
    if vehicle.fmu == "builtin":
        vehicle = vehicle.model_copy(update={"fmi_version": FMI})
    return scenario.model_copy(update={"vehicle": vehicle, "real_time": None})


def _network(scenario: Scenario, controller: Controller) -> Path:
    """Return the sensor's file; raises `InputError` for all that no SSP holds."""
    sensor = controller.sensor_of_run(scenario.sensor)
    latency = controller.latency_of_run(scenario.latency)
    wrong: list[tuple[tuple[str, ...], str]] = []
    if sensor.condition != "ideal":
        wrong.append((("sensor", "condition"), f"condition {sensor.condition}; take ideal"))
    if scenario.acting_faults:
        wrong.append((("faults",), "faults; leave them out"))
    if latency.sensor_ms or latency.damper_ms:
        wrong.append((("latency",), "latencies; leave them out"))
    problems = [
        scenario.problem(key, f"an SSP connects vehicle and sensor directly, without {what}")
        for key, what in wrong
    ]
    file = estimator_file(scenario, sensor)
    if file is None or file.suffix not in (".onnx", ".fmu"):
        sentence = (
            f"estimator {sensor.estimator} is no network, and an SSP holds FMUs only; take a "
            "network that cosim pack can pack"
        )
        problems.append(scenario.problem(("sensor", "estimator"), sentence))
    if problems or file is None:
        raise InputError(problems)
    return file


def _sensor_fmu(file: Path, folder: Path) -> Path:
    """Return the sensor's FMU, packed into `folder` if `file` is a network."""
    from cosim.pack.packing import pack

    if file.suffix == ".fmu":
        return file
    try:
        return pack(file, folder / f"{SENSOR}.fmu", FMI).path
    except SensorError as error:
        raise NetworkError(str(error)) from None


def _initial_inputs(wiring: Wiring, command: float) -> dict[str, Value]:
    """Return what the dampers hold before the first sample, by the FMU's own names and units."""
    return {
        w.variable: (command - w.offset) / w.factor for w in wiring.inputs if w.quantity in DAMPERS
    }


def _values(
    name: str, vehicle: Description, values: dict[str, Value], structure: Structure
) -> bytes:
    """Return the values that are not the FMU's own start values, as SSV."""
    changed = {key: v for key, v in values.items() if not _is_start(vehicle.variables[key], v)}
    units = {key: u for key in changed if (u := vehicle.unit_of(key)) is not None}
    return parameter_values(name, changed, units, structure.units)


def _is_start(variable: object, value: Value) -> bool:
    text = getattr(variable, "start", None)
    if isinstance(value, str):
        return value == (text or "")
    if text is None:
        return False
    if isinstance(value, bool):
        return value == (text in ("true", "1"))
    return float(text) == value
