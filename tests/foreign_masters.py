"""Masters that are not ours, behind one call: libcosim (Open Simulation Platform) and Ecos.

Each runs in a process of its own, since both are C++ libraries that know other ways to end than an
exception.
"""

from __future__ import annotations

import platform
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path

import fmpy
import pytest

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


def libcosim(task: Task) -> Rows:
    """The Open Simulation Platform's co-simulation engine; FMI 2 only."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.ERROR)
    variables = fmpy.read_model_description(str(task.fmu)).modelVariables
    reference = {v.name: v.valueReference for v in variables}
    inputs, outputs = ([reference[n] for n in names] for names in (task.inputs, task.outputs))
    execution = CosimExecution.from_step_size(task.step_size * 1e9)
    car = execution.add_local_slave(CosimLocalSlave(str(task.fmu), "car"))
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    execution.add_manipulator(manipulator)
    execution.add_observer(observer)
    for name, value in task.parameters.items():
        text = isinstance(value, str)
        setter = execution.string_initial_value if text else execution.real_initial_value
        assert setter(car, reference[name], value)
    rows = []
    for command in task.commands:
        assert manipulator.slave_real_values(car, inputs, command)
        assert execution.step()
        rows.append([float(value) for value in observer.last_real_values(car, outputs)])
    return rows


def ecos(task: Task) -> Rows:
    """Ecos; FMI 2 and 3."""
    from ecospy.EcosParameterSet import EcosParameterSet
    from ecospy.EcosSimulation import EcosSimulation
    from ecospy.EcosSimulationStructure import EcosSimulationStructure

    parameters = EcosParameterSet()
    for name, value in task.parameters.items():
        add = parameters.add_string if isinstance(value, str) else parameters.add_real
        add(f"car::{name}", value)
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
