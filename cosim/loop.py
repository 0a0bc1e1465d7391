"""The co-simulation loop. Each line is one arrow of the data flow; row k of the record is
everything at t_k = k h.

Driver and controller act on sample k and their commands are held over [t_k, t_k+1]: one sample of
delay, the same for every vehicle FMU.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.control.sample import Sample
from cosim.faults.latency import PromptDampers
from cosim.faults.stack import NoFaults
from cosim.recorder import Recorder
from cosim.testbench import State, Testbench

Array = npt.NDArray[np.float64]

PROGRESS_STEPS = 50
NOTHING = np.zeros(0)  # recorded in the place of what is the same as another group


class DriverBlock(Protocol):
    """Steers and works the pedals."""

    finished: bool

    def step(self, k: int, state: State) -> Array:
        """Return steering-wheel angle [rad], accelerator and brake (0..1), (3,)."""


class MeasurementBlock(Protocol):
    """Measures the channels as a car does."""

    def step(self, channels: Array, stage: Array) -> Array:
        """Take the ideal channels (14,) and what the vehicle's sensors deliver (11,); return the
        channels as measured (14,), `channels` itself where they are ideal.
        """


class FaultBlock(Protocol):
    """Does to the measured channels what happens to them on the way to the sensor; `bridged` (14,)
    are the channels of the last sample with the last value where one is missing.
    """

    bridged: Array

    def step(self, k: int, measured: Array) -> Array:
        """Take the channels (14,) of sample k as measured; return them as the sensor gets them, NaN
        where one is missing, `measured` itself where nothing ever happens to them.
        """


class SensorBlock(Protocol):
    """Estimates the suspension velocities; `deviation` (4,) [m/s] is the standard deviation that it
    expects of its error, NaN if it expects none.
    """

    estimate: Array
    deviation: Array

    def step(self, measured: Array, command: Array) -> bool:
        """Take the 14 channels and the damper command (4,) held until now, update `estimate` (4,)
        [m/s]; return whether it is valid.
        """


class ControllerBlock(Protocol):
    """Commands the dampers; `command` (4,) is, before the first sample, the initial command."""

    command: Array

    def step(self, sample: Sample) -> Array:
        """Return the damper commands (4,), 0 soft to 1 hard, from what is known at t_k."""


class DamperBlock(Protocol):
    """Brings the command to the dampers."""

    def step(self, command: Array) -> Array:
        """Take the command (4,) given now; return the one that the dampers hold from now on, which
        is `command` itself where it is never late.
        """


class ClockBlock(Protocol):
    """Decides when a sample is due."""

    def wait(self, k: int) -> bool:
        """Return when sample k is due, at once where nothing goes by the clock; False to stop."""


@dataclass(frozen=True)
class Blocks:
    """The four roles; measurement and faults between vehicle and sensor; the way to the dampers."""

    vehicle: Testbench
    driver: DriverBlock
    measurement: MeasurementBlock
    sensor: SensorBlock
    controller: ControllerBlock
    faults: FaultBlock = field(default_factory=NoFaults)
    dampers: DamperBlock = field(default_factory=PromptDampers)


def run(
    blocks: Blocks,
    clock: ClockBlock,
    recorder: Recorder,
    steps: int,
    progress: Callable[[int, int], None] | None = None,
) -> int:
    """Run until the driver has finished or the clock stops, at most `steps` steps; return the
    number of the last row.

    Whatever raises on the way leaves the rows before it in the recorder.
    """
    vehicle, driver, measurement = blocks.vehicle, blocks.driver, blocks.measurement
    sensor, controller = blocks.sensor, blocks.controller
    faults, dampers = blocks.faults, blocks.dampers
    command = controller.command  # the vehicle stands at t_0 with the initial one
    sample = Sample()
    for k in range(steps + 1):
        if not clock.wait(k):  # in real time: until t_k
            return k - 1
        state = vehicle.read()  # vehicle -> outputs at t_k
        measured = measurement.step(state.channels, state.stage)  # outputs -> channels of a car
        given = faults.step(k, measured)  # channels of a car -> what arrives of them
        valid = sensor.step(given, command)  # channels -> estimates, or invalid
        sample.renewed(faults.bridged, sensor.estimate, sensor.deviation, valid, state.truth)
        command = controller.step(sample)  # what is known -> damper commands
        held = dampers.step(command)  # command -> what the dampers hold
        pedals = driver.step(k, state)
        recorder.append(
            k, given, sensor.estimate, sensor.deviation, valid, state.truth, command, pedals,
            state.recorded, NOTHING if measured is state.channels else state.channels,
            NOTHING if given is measured else measured, NOTHING if held is command else held,
        )  # fmt: skip
        if progress is not None and k % PROGRESS_STEPS == 0:
            progress(k, steps)
        if k == steps or driver.finished:
            break
        vehicle.write(pedals, held)  # to be held over [t_k, t_k+1]
        vehicle.step(k)
    return k
