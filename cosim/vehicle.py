"""The vehicle block: a co-simulation FMU behind `read` and `step`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.errors import FmuError
from cosim.fmi import Description, Slave, Value
from cosim.quantities import (
    CHANNEL_QUANTITIES,
    DAMPERS,
    DRIVER,
    POSE,
    RECORDED,
    SENSOR_STAGE,
    TRUTH,
    Quantity,
)
from cosim.wiring import Wire, Wiring

Array = npt.NDArray[np.float64]


def builtin_fmu(fmi_version: int = 3) -> Path:
    """Return the package's own vehicle FMU; raises `FmuError` if it was never built."""
    path = Path(str(resources.files("cosim") / "fmus" / f"vehicle.fmi{fmi_version}.fmu"))
    if not path.is_file():
        raise FmuError(f"{path}: missing; build it with 'pip install .' or 'python fmu/build.py'")
    return path


@dataclass(frozen=True)
class State:
    """The vehicle's outputs at t_k in SI units; views of one buffer that `Vehicle.read` refills.

    channels (14,), truth (4,) [m/s, positive in extension], pose (3,) [m, m, rad],
    recorded (all beside channels and truth, in the order of `RECORDED`), stage (11,) what
    production sensors deliver (`sensor.STAGE`); NaN where the FMU has none.
    """

    channels: Array
    truth: Array
    pose: Array
    recorded: Array
    stage: Array


class Vehicle:
    """A vehicle FMU, initialised and ready to be stepped.

    `wiring` says which variable carries which quantity; `start_values` are in the FMU's own names
    and units. Raises `FmuError` with the FMU's own words, or naming the variable that is not a
    number.
    """

    def __init__(
        self,
        description: Description,
        wiring: Wiring,
        start_values: Mapping[str, Value],
        step_s: float,
        initial_command: Array | float = 0.0,
    ) -> None:
        self.step_s = step_s
        self._slave = Slave(
            description, [w.variable for w in wiring.inputs], [w.variable for w in wiring.outputs]
        )
        self._values = np.full(len(CHANNEL_QUANTITIES) + len(TRUTH) + len(RECORDED), np.nan)
        self._prepare_outputs(wiring.outputs)
        self._prepare_inputs(wiring.inputs)
        n, m = len(CHANNEL_QUANTITIES), len(CHANNEL_QUANTITIES) + len(TRUTH)
        recorded = self._values[m:]
        stage = RECORDED.index(SENSOR_STAGE[0])
        self._state = State(
            channels=self._values[:n],
            truth=self._values[n:m],
            pose=recorded[: len(POSE)],
            recorded=recorded,
            stage=recorded[stage : stage + len(SENSOR_STAGE)],
        )
        self._commands[len(DRIVER) :] = initial_command
        self._hold()
        try:
            self._slave.initialise(dict(start_values))
        except FmuError:
            self._slave.close()
            raise

    def read(self) -> State:
        """Return the outputs at the present time; the same object every time, refilled."""
        slave, values = self._slave, self._values
        slave.read()
        if self._identity:
            np.multiply(slave.outputs, self._factor, out=values)
        else:
            values[self._place] = slave.outputs * self._factor + self._offset
        return self._state

    def step(self, k: int, driver_command: Array, damper_command: Array) -> None:
        """Hold both commands over [t_k, t_k+1]: (3,) steer [rad], gas, brake; (4,) dampers 0..1."""
        commands = self._commands
        commands[: len(DRIVER)] = driver_command
        commands[len(DRIVER) :] = damper_command
        self._hold()
        self._slave.step(k, self.step_s)

    def check_finite(self, k: int) -> None:
        """Raise `FmuError` naming the first output that is not a number, the time and the last
        inputs.
        """
        outputs = self._slave.outputs
        if math.isfinite(outputs.dot(outputs)):  # one call; a huge but finite value is found below
            return
        for name, value in zip(self._slave.output_names, outputs, strict=True):
            if not np.isfinite(value):
                held = ", ".join(
                    f"{n} = {v:.6g}"
                    for n, v in zip(self._slave.input_names, self._slave.inputs, strict=True)
                )
                raise FmuError(
                    f"{self._slave.description.path.name}: {name} is {value} at "
                    f"t = {k * self.step_s:.6g} s; the last inputs were {held}"
                )

    def close(self) -> None:
        """Free the FMU; may be called twice."""
        self._slave.close()

    def _hold(self) -> None:
        inputs = self._slave.inputs
        if self._commands is inputs:
            return
        self._commands.take(self._source, out=inputs, mode="clip")
        np.subtract(inputs, self._input_offset, out=inputs)
        np.divide(inputs, self._input_factor, out=inputs)

    def _prepare_outputs(self, wires: tuple[Wire, ...]) -> None:
        order: dict[Quantity, int] = {
            q: i for i, q in enumerate((*CHANNEL_QUANTITIES, *TRUTH, *RECORDED))
        }
        self._place = np.array([order[w.quantity] for w in wires])
        self._factor = np.array([w.factor for w in wires])
        self._offset = np.array([w.offset for w in wires])
        complete = np.array_equal(self._place, np.arange(len(order)))
        self._identity = complete and not self._offset.any()

    def _prepare_inputs(self, wires: tuple[Wire, ...]) -> None:
        order = {q: i for i, q in enumerate((*DRIVER, *DAMPERS))}
        self._source = np.array([order[w.quantity] for w in wires], dtype=np.intp)
        self._input_factor = np.array([w.factor for w in wires])
        self._input_offset = np.array([w.offset for w in wires])
        alike = (
            np.array_equal(self._source, np.arange(len(order)))
            and (self._input_factor == 1).all()
            and not self._input_offset.any()
        )
        # Where nothing has to be converted, the commands are written into the FMU's inputs at once.
        self._commands = self._slave.inputs if alike else np.zeros(len(order))
