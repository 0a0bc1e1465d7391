"""Masters that are not ours, behind one call: libcosim (Open Simulation Platform), Ecos and FMPy.

Each of the first two runs in a process of its own, since both are C++ libraries that know other
ways to end than an exception.
"""

from __future__ import annotations

import io
import platform
import shutil
import sys
import zipfile
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.ssp.ssd import read_ssv

Rows = list[list[float]]


@dataclass(frozen=True)
class Task:
    """One FMU, its real and text parameters, its inputs step by step, and what to read."""

    fmu: Path
    step_size: float  # s
    parameters: dict[str, float | str]
    inputs: tuple[str, ...]
    commands: Rows  # one row to each step
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Pair:
    """A vehicle FMU and a sensor FMU that reads its outputs: real and text parameters of the
    vehicle, what each is set to step by step beside what is connected, and what to read of the
    sensor.
    """

    car: Path
    sensor: Path
    step_size: float  # s
    parameters: dict[str, float | str]
    car_inputs: tuple[str, ...]
    sensor_inputs: tuple[str, ...]
    commands: Rows  # one row to each step: the car's inputs, then the sensor's
    connected: tuple[str, ...]  # outputs of the car and inputs of the sensor, by one name
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Ssp:
    """A package of a vehicle and a sensor, as a file and unpacked: what the vehicle is set to step
    by step, and what to read of the sensor.
    """

    file: Path
    folder: Path
    step_size: float  # s
    inputs: tuple[str, ...]
    commands: Rows  # one row to each step
    outputs: tuple[str, ...]


def available(master: str) -> None:
    """Skip where the master cannot be installed; fail where it only has not been."""
    if (sys.platform, platform.machine()) != ("linux", "x86_64"):
        pytest.skip(f"{master} has no wheel that runs on {sys.platform} {platform.machine()}")
    if find_spec(master) is None:
        pytest.fail(f"{master} is not installed; it is part of the extra 'test'")
    if master == "ecospy":
        try:
            import ecospy.lib  # noqa: F401  # type: ignore[import-not-found, unused-ignore]
        except OSError as error:  # a system library that no wheel brings
            pytest.skip(f"{error}; on Debian and Ubuntu: apt install libtbb12")


def run(master: str, tasks: list[Task]) -> list[Rows]:
    """Outputs after each step of each task, one task after the other in one process."""
    available(master)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return list(pool.map({"libcosimpy": libcosim, "ecospy": ecos}[master], tasks))


def run_pair(master: str, pair: Pair) -> Rows:
    """Outputs of the sensor after each step."""
    if master == "fmpy":
        return fmpy_pair(pair)
    available(master)
    runner = {"libcosimpy": libcosim_pair, "ecospy": ecos_pair}[master]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(runner, pair).result()


def run_ssp(master: str, ssp: Ssp) -> Rows:
    """Outputs of the package's sensor after each step."""
    available(master)
    runner = {"libcosimpy": libcosim_ssp, "ecospy": ecos_ssp}[master]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(runner, ssp).result()


def references(fmu: Path) -> dict[str, int]:
    """Value references by name."""
    return {v.name: v.valueReference for v in fmpy.read_model_description(str(fmu)).modelVariables}


def start_values(
    execution: Any, slave: int, reference: Mapping[str, int], parameters: Mapping[str, Any]
) -> None:
    """Give one FMU in libcosim its start values."""
    for name, value in parameters.items():
        text = isinstance(value, str)
        setter = execution.string_initial_value if text else execution.real_initial_value
        assert setter(slave, reference[name], value)


def ecos_parameters(parameters: Mapping[str, Any]) -> Any:
    """Start values of the FMU `car` as Ecos takes them."""
    from ecospy.EcosParameterSet import EcosParameterSet

    found = EcosParameterSet()
    for name, value in parameters.items():
        add = found.add_string if isinstance(value, str) else found.add_real
        add(f"car::{name}", value)
    return found


def libcosim(task: Task) -> Rows:
    """The Open Simulation Platform's co-simulation engine; FMI 2 only."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.ERROR)
    reference = references(task.fmu)
    inputs, outputs = ([reference[n] for n in names] for names in (task.inputs, task.outputs))
    execution = CosimExecution.from_step_size(task.step_size * 1e9)
    car = execution.add_local_slave(CosimLocalSlave(str(task.fmu), "car"))
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    execution.add_manipulator(manipulator)
    execution.add_observer(observer)
    start_values(execution, car, reference, task.parameters)
    rows = []
    for command in task.commands:
        assert manipulator.slave_real_values(car, inputs, command)
        assert execution.step()
        rows.append([float(value) for value in observer.last_real_values(car, outputs)])
    return rows


def ecos(task: Task) -> Rows:
    """Ecos; FMI 2 and 3."""
    from ecospy.EcosSimulation import EcosSimulation
    from ecospy.EcosSimulationStructure import EcosSimulationStructure

    parameters = ecos_parameters(task.parameters)
    rows = []
    with EcosSimulationStructure() as structure:
        structure.add_model("car", str(task.fmu))
        structure.add_parameter_set("start", parameters)
        with EcosSimulation(structure=structure, step_size=task.step_size) as simulation:
            assert simulation.init(parameter_set="start")
            for command in task.commands:
                for name, value in zip(task.inputs, command, strict=True):
                    simulation.set_real(f"car::{name}", value)
                simulation.step(1)
                rows.append([simulation.get_real(f"car::{name}") for name in task.outputs])
            simulation.terminate()
    parameters.free()
    return rows


def libcosim_pair(pair: Pair) -> Rows:
    """Vehicle and sensor in libcosim."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.ERROR)
    of_car, of_sensor = references(pair.car), references(pair.sensor)
    execution = CosimExecution.from_step_size(pair.step_size * 1e9)
    car = execution.add_local_slave(CosimLocalSlave(str(pair.car), "car"))
    sensor = execution.add_local_slave(CosimLocalSlave(str(pair.sensor), "sensor"))
    for name in pair.connected:
        assert execution.connect_real_variables(car, of_car[name], sensor, of_sensor[name]) == 0
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    execution.add_manipulator(manipulator)
    execution.add_observer(observer)
    start_values(execution, car, of_car, pair.parameters)
    rows, n = [], len(pair.car_inputs)
    for command in pair.commands:
        ours = (of_car[name] for name in pair.car_inputs)
        assert manipulator.slave_real_values(car, list(ours), command[:n])
        theirs = [of_sensor[name] for name in pair.sensor_inputs]
        assert not theirs or manipulator.slave_real_values(sensor, theirs, command[n:])
        assert execution.step()
        values = observer.last_real_values(sensor, [of_sensor[name] for name in pair.outputs])
        rows.append([float(value) for value in values])
    return rows


def ecos_pair(pair: Pair) -> Rows:
    """Vehicle and sensor in Ecos."""
    from ecospy.EcosSimulation import EcosSimulation
    from ecospy.EcosSimulationStructure import EcosSimulationStructure

    parameters = ecos_parameters(pair.parameters)
    set_by_us = [f"car::{name}" for name in pair.car_inputs]
    set_by_us += [f"sensor::{name}" for name in pair.sensor_inputs]
    rows = []
    with EcosSimulationStructure() as structure:
        structure.add_model("car", str(pair.car))
        structure.add_model("sensor", str(pair.sensor))
        structure.add_parameter_set("start", parameters)
        for name in pair.connected:
            structure.make_real_connection(f"car::{name}", f"sensor::{name}")
        with EcosSimulation(structure=structure, step_size=pair.step_size) as simulation:
            assert simulation.init(parameter_set="start")
            for command in pair.commands:
                for name, value in zip(set_by_us, command, strict=True):
                    simulation.set_real(name, value)
                simulation.step(1)
                rows.append([simulation.get_real(f"sensor::{name}") for name in pair.outputs])
            simulation.terminate()
    parameters.free()
    return rows


def libcosim_ssp(ssp: Ssp) -> Rows:
    """A package in libcosim, which reads an unpacked one."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_ssp_file(str(ssp.folder), ssp.step_size * 1e9)
    car, sensor = map(execution.slave_index_from_instance_name, ("vehicle", "sensor"))
    of_car, of_sensor = (
        references(ssp.folder / f"resources/{n}.fmu") for n in ("vehicle", "sensor")
    )
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    execution.add_manipulator(manipulator)
    execution.add_observer(observer)
    inputs, outputs = [of_car[n] for n in ssp.inputs], [of_sensor[n] for n in ssp.outputs]
    rows = []
    for command in ssp.commands:
        assert manipulator.slave_real_values(car, inputs, command)
        assert execution.step()
        rows.append([float(value) for value in observer.last_real_values(sensor, outputs)])
    return rows


def ecos_ssp(ssp: Ssp) -> Rows:
    """A package in Ecos."""
    from ecospy.EcosSimulation import EcosSimulation

    rows = []
    with zipfile.ZipFile(ssp.file) as archive:
        name = read_ssv(io.BytesIO(archive.read("resources/parameters.ssv"))).name
    with EcosSimulation(ssp_path=str(ssp.file), step_size=ssp.step_size) as simulation:
        assert simulation.init(parameter_set=name)
        for command in ssp.commands:
            for variable, value in zip(ssp.inputs, command, strict=True):
                simulation.set_real(f"vehicle::{variable}", value)
            simulation.step(1)
            rows.append([simulation.get_real(f"sensor::{n}") for n in ssp.outputs])
        simulation.terminate()
    return rows


def fmpy_pair(pair: Pair) -> Rows:
    """Vehicle and sensor in a loop of FMPy's own calls."""
    car, sensor = (_fmpy_instance(path) for path in (pair.car, pair.sensor))
    of_car, of_sensor = references(pair.car), references(pair.sensor)
    for name, value in pair.parameters.items():
        kind = "String" if isinstance(value, str) else _real(car)
        getattr(car, f"set{kind}")([of_car[name]], [value])
    for one in (car, sensor):
        one.enterInitializationMode()
        one.exitInitializationMode()
    rows, n = [], len(pair.car_inputs)
    for k, command in enumerate(pair.commands):
        measured = _get(car, [of_car[name] for name in pair.connected])
        _set(car, [of_car[name] for name in pair.car_inputs], command[:n])
        own = [of_sensor[name] for name in (*pair.connected, *pair.sensor_inputs)]
        _set(sensor, own, [*measured, *command[n:]])
        for one in (car, sensor):
            one.doStep(k * pair.step_size, pair.step_size)
        rows.append([float(v) for v in _get(sensor, [of_sensor[name] for name in pair.outputs])])
    for one in (car, sensor):
        one.terminate()
        one.freeInstance()
        shutil.rmtree(one.unzipDirectory)
    return rows


def _fmpy_instance(path: Path) -> Any:
    description = fmpy.read_model_description(str(path))
    kind = FMU2Slave if description.fmiVersion == "2.0" else FMU3Slave
    one = kind(
        guid=description.guid,
        unzipDirectory=fmpy.extract(str(path)),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=path.stem,
    )
    one.instantiate()
    if kind is FMU2Slave:
        one.setupExperiment(startTime=0.0)
    return one


def _real(one: Any) -> str:
    return "Real" if isinstance(one, FMU2Slave) else "Float64"


def _get(one: Any, variables: list[int]) -> list[float]:
    return list(getattr(one, f"get{_real(one)}")(variables))


def _set(one: Any, variables: list[int], values: list[float]) -> None:
    if variables:
        getattr(one, f"set{_real(one)}")(variables, values)
