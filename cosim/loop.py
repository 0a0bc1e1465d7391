"""The co-simulation loop. Each line is one arrow of the data flow; row k of the record is
everything at t_k = k h.

Driver and controller act on sample k and their commands are held over [t_k, t_k+1]: one sample of
delay, the same for every vehicle FMU.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.control.sample import Sample
from cosim.recorder import Recorder
from cosim.vehicle import State

Array = npt.NDArray[np.float64]

PROGRESS_STEPS = 50
NOTHING = np.zeros(0)  # recorded in the place of ideal channels that are the measured ones


class VehicleBlock(Protocol):
    """Steps a car and reads its outputs."""

    def read(self) -> State:
        """Return the outputs at the present time."""

    def step(self, k: int, driver_command: Array, damper_command: Array) -> None:
        """Hold both commands over [t_k, t_k+1]."""

    def check_finite(self, k: int) -> None:
        """Raise `FmuError` if an output that was read is no number."""


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


@dataclass(frozen=True)
class Blocks:
    """The four roles, and the measurement between vehicle and sensor."""

    vehicle: VehicleBlock
    driver: DriverBlock
    measurement: MeasurementBlock
    sensor: SensorBlock
    controller: ControllerBlock


def run(
    blocks: Blocks,
    recorder: Recorder,
    steps: int,
    progress: Callable[[int, int], None] | None = None,
) -> int:
    """Run until the driver has finished, at most `steps` steps; return the number of the last row.

    Whatever raises on the way leaves the rows before it in the recorder.
    """
    vehicle, driver, measurement = blocks.vehicle, blocks.driver, blocks.measurement
    sensor, controller = blocks.sensor, blocks.controller
    command = controller.command  # the vehicle stands at t_0 with the initial one
    sample = Sample()
    for k in range(steps + 1):
        state = vehicle.read()  # vehicle -> outputs at t_k
        vehicle.check_finite(k)
        measured = measurement.step(state.channels, state.stage)  # outputs -> channels of a car
        valid = sensor.step(measured, command)  # channels -> estimates, or invalid
        sample.renewed(measured, sensor.estimate, sensor.deviation, valid, state.truth)
        command = controller.step(sample)  # what is known -> damper commands
        pedals = driver.step(k, state)
        ideal = NOTHING if measured is state.channels else state.channels
        recorder.append(
            k, measured, sensor.estimate, sensor.deviation, valid, state.truth,
            command, pedals, state.recorded, ideal,
        )  # fmt: skip
        if progress is not None and k % PROGRESS_STEPS == 0:
            progress(k, steps)
        if k == steps or driver.finished:
            break
        vehicle.step(k, pedals, command)  # hold both over [t_k, t_k+1]
    return k
