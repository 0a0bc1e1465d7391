"""From a scenario to the blocks of one run, connected and ready."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from cosim import loop
from cosim.bus.assemble import bus_problems, bus_sensor
from cosim.control.choice import controller_of
from cosim.control.damper_map import damper_map
from cosim.control.from_fmu import controller_problems, fmu_controller
from cosim.controller_fmu import FmuController
from cosim.course import Course, course_of
from cosim.driver import PathDriver
from cosim.errors import InputError, Problem
from cosim.faults.assemble import damper_block, fault_block, late_sensor, over_gaps
from cosim.fmi import Description, Value
from cosim.grip import grip_figures
from cosim.loop import Blocks, ControllerBlock, SensorBlock
from cosim.manoeuvre import Plan, friction_of, manoeuvre_of, motion_of
from cosim.manoeuvre.programme import ProgrammedDriver
from cosim.quantities import (
    ATTITUDE,
    DAMPER_FORCE,
    DAMPER_SPEED,
    GRIP_SHARE,
    SEAT,
    TRAVEL,
    TYRE_LOAD,
    Quantity,
)
from cosim.realtime.clock import Clock, clock_of
from cosim.record import record_groups_of
from cosim.recorder import Recorder
from cosim.ride import Ride, ride_figures
from cosim.scenario.controllers import Controller, ControllerFmu, Passive
from cosim.scenario.schema import Scenario
from cosim.sensor import estimator_file, estimator_of, measurement_of, stage_problems
from cosim.sensor_fmu import FmuSensor
from cosim.start import builtin_start, checked_parameters
from cosim.testbench import Testbench
from cosim.vehicle import Vehicle, builtin_fmu
from cosim.wiring import Wiring, mapped_wiring, own_wiring
from sensor import SAMPLE_RATE_HZ
from sensor.conditions import PRODUCTION_PARAMETERS

if TYPE_CHECKING:
    from cosim.bus.sensor import BusSensor

Array = npt.NDArray[np.float64]

STEP_S: Final = 1 / SAMPLE_RATE_HZ
SETTLING_S: Final = 2.0  # left out of the ride figures: the road's unevenness is still fading in
LATE: Final = 1.3  # a driver this much slower than his profile has come to grief


@dataclass(frozen=True)
class RunResult:
    """How a run ended. `comfort` and `grip` are empty where the vehicle lacks the signals,
    `manoeuvre` where the road was followed or the manoeuvre cut short, `bus` where the sensor is on
    none; times in s, deviation in m.
    """

    steps_done: int
    wall_time_s: float
    simulated_s: float
    lap_time_s: float | None
    finish_reason: str
    comfort: Mapping[str, float]
    largest_deviation_m: float
    manoeuvre: Mapping[str, float]
    grip: Mapping[str, Mapping[str, float]]
    timing: Mapping[str, Any]
    bus: Mapping[str, float]


@dataclass
class Assembly:
    """The blocks of one run. `files` decide the result: fmu, sensor, road; `initial_command` (4,)
    is what the dampers hold before the first sample.
    """

    recorder: Recorder
    initial_command: Array
    files: Mapping[str, Path]
    blocks: Blocks
    clock: Clock
    driver: PathDriver | ProgrammedDriver
    plan: Plan
    steps: int
    if_late: str  # why the run ends where the driver has not come to the end
    sensor_fmu: FmuSensor | None = None  # the estimator behind the sensor, if it is an FMU
    controller_fmu: FmuController | None = None  # what commands the dampers, if it is an FMU
    bus: BusSensor | None = None

    def run(self, progress: Callable[[int, int], None] | None) -> RunResult:
        """Run to the end of the lap or the last step, and let go of the bench whatever happens."""
        try:
            if self.bus is not None:
                self.bus.open()
            if self.controller_fmu is not None:
                self.controller_fmu.connect()
            self.blocks.vehicle.connect()
            begin = time.perf_counter()
            with self.clock:
                last = loop.run(self.blocks, self.clock, self.recorder, self.steps, progress)
            wall = time.perf_counter() - begin
        finally:
            self.blocks.vehicle.stop()
            if self.sensor_fmu is not None:
                self.sensor_fmu.close()
            if self.controller_fmu is not None:
                self.controller_fmu.close()
            if self.bus is not None:
                self.bus.close()
        done = self.driver.completed
        return RunResult(
            steps_done=last,
            wall_time_s=wall,
            simulated_s=last * STEP_S,
            lap_time_s=last * STEP_S if done else None,
            finish_reason=self.clock.stopped or (self.plan.end if done else self._unfinished()),
            comfort=_comfort(self.recorder),
            largest_deviation_m=self.driver.largest_deviation,
            manoeuvre=self.plan.figures(motion_of(self.recorder)),
            grip=grip_figures(_recorded(self.recorder, GRIP_SHARE)),
            timing=self.clock.figures(),
            bus={} if self.bus is None else self.bus.figures(),
        )

    def _unfinished(self) -> str:
        return "the road ended before the manoeuvre" if self.driver.finished else self.if_late


def check(scenario: Scenario) -> float:
    """Look for all that can be wrong with a scenario before its first step, and build its road.

    Returns the simulated time that a run of it may take [s]. Raises `InputError` with everything
    wrong, `FmuError` or `NetworkError` for a file that does not load.
    """
    *_, plan = checked_parts(scenario)
    for controller in scenario.controllers:
        estimator_file(scenario, controller.sensor_of_run(scenario.sensor))
    return _steps(scenario, plan)[0] * STEP_S


def assemble(
    scenario: Scenario,
    controller: Controller,
    sensor: SensorBlock | None = None,
    dampers: ControllerBlock | None = None,
    roads: Path | None = None,
    bench: Testbench | None = None,
) -> Assembly:
    """Connect the blocks of `scenario` with one of its controllers.

    `sensor` and `dampers` replace the scenario's own (the data set is built so), `bench` its FMU;
    `roads` is where its road is kept in place of the cache. Raises
    `InputError` with everything wrong in the scenario, `FmuError` or `NetworkError` for a file that
    does not load.
    """
    wiring, description, course, plan = checked_parts(scenario, roads)
    file, own, bus, acting = None, None, None, scenario.acting_faults
    if sensor is None:
        settings = controller.sensor_of_run(scenario.sensor)
        file = estimator_file(scenario, settings)
        if settings.bus is not None:
            sensor = bus = bus_sensor(settings, file)
        else:
            own = estimator_of(scenario, settings)
            sensor = over_gaps(own, acting)
    latency = controller.latency_of_run(scenario.latency)
    sensor = late_sensor(sensor, latency)
    passive = isinstance(controller, Passive) and dampers is None
    start = start_values(scenario, description, course, plan, passive)
    fmu = None
    if dampers is None and isinstance(controller, ControllerFmu):
        fmu = fmu_controller(scenario, controller)
    block = dampers or controller_of(controller, damper_map(scenario.parameters), fmu)
    steps, if_late = _steps(scenario, plan)
    driver = plan.driver(STEP_S, friction_of(scenario))
    recorder = Recorder(record_groups_of(scenario, controller), steps + 1, STEP_S)
    vehicle = bench or Vehicle(description, wiring, start, STEP_S, block.command)
    files = {"fmu": description.path, "sensor": file, "road": course.file}
    files |= {} if fmu is None else {"controller": fmu.path}
    files |= {f"variant {name}": path for name, path in scenario.variants.files.items()}
    files |= {f"fault {name}": path for name, path in scenario.fault_files.items()}
    return Assembly(
        recorder=recorder,
        initial_command=block.command.copy(),
        files={name: path for name, path in files.items() if path is not None},
        blocks=Blocks(
            vehicle,
            driver,
            measurement_of(scenario),
            sensor,
            block,
            fault_block(acting, scenario.seed),
            damper_block(latency, block.command),
        ),
        clock=clock_of(scenario.real_time, STEP_S, steps + 1),
        driver=driver,
        plan=plan,
        steps=steps,
        if_late=if_late,
        sensor_fmu=own if isinstance(own, FmuSensor) else None,
        controller_fmu=fmu,
        bus=bus,
    )


def checked_parts(
    scenario: Scenario, roads: Path | None = None
) -> tuple[Wiring, Description, Course, Plan]:
    """Return the vehicle FMU, its wiring, the course and what is driven on it, after all that can
    be wrong was looked for; raises `InputError` with every problem.
    """
    settings = scenario.vehicle
    own = settings.fmu == "builtin"
    description = Description(
        builtin_fmu(settings.fmi_version) if own else scenario.resolve(settings.fmu)
    )
    wiring, problems = (
        (own_wiring(), [])
        if own
        else mapped_wiring(description, settings.variables, scenario.problem)
    )
    problems += checked_parameters(scenario, description)
    problems += stage_problems(scenario, wiring, description.path.name) + bus_problems(scenario)
    problems += controller_problems(scenario)
    found = None
    try:
        found = _planned(scenario, roads)
    except InputError as error:
        problems += error.problems
    if problems or found is None:
        raise InputError(sorted(problems, key=_line))
    return wiring, description, *found


def _planned(scenario: Scenario, roads: Path | None) -> tuple[Course, Plan]:
    """Return the course and what is driven on it; raises `InputError`."""
    manoeuvre = manoeuvre_of(scenario, STEP_S)
    needed = manoeuvre.road_length
    course = course_of(scenario, needed, roads)
    track = course.track
    if scenario.driver.speed_kmh is None and not np.isfinite(track.speed_limit).all():
        sentence = f"the {track.name} road has no speed limit: give driver.speed_kmh"
        raise InputError(scenario.problem(("driver", "speed_kmh"), sentence))
    if needed is not None and track.length < needed:
        sentence = f"the manoeuvre needs {needed:.0f} m of road; this one has {track.length:.0f} m"
        raise InputError(scenario.problem(("road", "length_m"), sentence))
    try:
        plan = manoeuvre.plan(track)
    except ValueError as error:
        raise InputError(scenario.problem(("manoeuvre",), str(error))) from None
    _check_length(scenario, plan)
    return course, plan


def _line(problem: Problem) -> int:
    return problem.place.line if problem.place is not None else 0


def start_values(
    scenario: Scenario, description: Description, course: Course, plan: Plan, passive: bool
) -> dict[str, Value]:
    """Return the vehicle's start values; of ours, another FMU gets those that it has by the same
    names.
    """
    speed = float(plan.speed[int(np.searchsorted(plan.line.s, 0.0))])
    own = builtin_start(course, plan.line, speed, passive, scenario.road.friction)
    own = {**PRODUCTION_PARAMETERS, **own}
    known = {name: value for name, value in own.items() if name in description.variables}
    return known | scenario.parameters


def _check_length(scenario: Scenario, plan: Plan) -> None:
    """Raise `InputError` where the road ends before the scenario's duration is over."""
    if scenario.duration == "lap" or scenario.manoeuvre is not None:
        return
    if float(scenario.duration) > plan.expected_s:
        sentence = (
            f"the road ends after about {plan.expected_s:.0f} s, before the duration of "
            f"{float(scenario.duration):g} s: give a longer road, or duration: lap"
        )
        raise InputError(scenario.problem(("duration",), sentence))


def _steps(scenario: Scenario, plan: Plan) -> tuple[int, str]:
    """Return how many steps at most, and why the run ends there if the road does not end before."""
    late = math.ceil(LATE * plan.expected_s / STEP_S)
    if scenario.duration != "lap" and (wanted := float(scenario.duration) / STEP_S) <= late:
        return max(round(wanted), 1), "duration reached"
    return late, "lap not finished" if scenario.manoeuvre is None else "manoeuvre not finished"


def _comfort(recorder: Recorder) -> dict[str, float]:
    settled = round(SETTLING_S / STEP_S)
    quantities = (SEAT, TRAVEL, TYRE_LOAD, ATTITUDE[1:], DAMPER_FORCE, DAMPER_SPEED)
    ride = Ride(*(_recorded(recorder, q)[settled:] for q in quantities))
    return ride_figures(ride, SAMPLE_RATE_HZ)


def _recorded(recorder: Recorder, quantities: Sequence[Quantity]) -> Array:
    return recorder.columns([quantity.name for quantity in quantities])


__all__ = ["Assembly", "RunResult", "assemble", "checked_parts", "start_values"]
