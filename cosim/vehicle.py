"""The vehicle block: a co-simulation FMU as a test bench."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.errors import FmuError
from cosim.fmi import Description, Slave, Value
from cosim.quantities import (
    DAMPERS,
    DRIVER,
    OUTPUT_QUANTITIES,
    Quantity,
)
from cosim.testbench import State
from cosim.wiring import Wire, Wiring

Array = npt.NDArray[np.float64]


def builtin_fmu(fmi_version: int = 3) -> Path:
    """Return the package's own vehicle FMU; raises `FmuError` if it was never built."""
    path = Path(str(resources.files("cosim") / "fmus" / f"vehicle.fmi{fmi_version}.fmu"))
    if not path.is_file():
        raise FmuError(f"{path}: missing; build it with 'pip install .' or 'python fmu/build.py'")
    return path


class Vehicle:
    """A vehicle FMU as a test bench.

    `wiring` says which variable carries which quantity; `start_values` are in the FMU's own names
    and units. Every failing call raises `FmuError` with the FMU's own words, or naming the variable
    that is not a number.
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
        self._description, self._wiring = description, wiring
        self._start_values = dict(start_values)
        self._initial_command = np.full(len(DAMPERS), initial_command)
        self._k, self._connected = 0, False
        self._values = np.full(len(OUTPUT_QUANTITIES), np.nan)
        self._state = State.over(self._values)
        self._prepare_outputs(wiring.outputs)

    def connect(self) -> None:
        """Load the FMU and initialise it at t = 0, the dampers at the initial command."""
        wiring = self._wiring
        self._slave = Slave(
            self._description,
            [w.variable for w in wiring.inputs],
            [w.variable for w in wiring.outputs],
        )
        self._prepare_inputs(wiring.inputs)
        self._k, self._connected = 0, True
        self.write(np.zeros(len(DRIVER)), self._initial_command)
        try:
            self._slave.initialise(self._start_values)
        except FmuError:
            self.stop()
            raise

    def read(self) -> State:
        """Return the outputs at the present time; the same object every time, refilled."""
        slave, values = self._slave, self._values
        slave.read()
        self._check_finite(slave.outputs)
        if self._identity:
            np.multiply(slave.outputs, self._factor, out=values)
        else:
            values[self._place] = slave.outputs * self._factor + self._offset
        return self._state

    def write(self, driver_command: Array, damper_command: Array) -> None:
        """Hold both commands from now on: (3,) steer [rad], gas, brake; (4,) dampers 0..1."""
        commands = self._commands
        commands[: len(DRIVER)] = driver_command
        commands[len(DRIVER) :] = damper_command
        self._hold()

    def step(self, k: int) -> None:
        """Go from t_k to t_k+1."""
        self._slave.step(k, self.step_s)
        self._k = k + 1

    def stop(self) -> None:
        """Free the FMU; may be called twice, and without `connect`."""
        if self._connected:
            self._slave.close()

    def _check_finite(self, outputs: Array) -> None:
        """Raise `FmuError` naming the first output that is not a number, the time and the last
        inputs.
        """
        if math.isfinite(outputs.dot(outputs)):  # one call; a huge but finite value is found below
            return
        for name, value in zip(self._slave.output_names, outputs, strict=True):
            if not np.isfinite(value):
                raise FmuError(
                    f"{self._slave.description.path.name}: {name} is {value} at "
                    f"t = {self._k * self.step_s:.6g} s; the last inputs were "
                    f"{self._slave.held}"
                )

    def _hold(self) -> None:
        inputs = self._slave.inputs
        if self._commands is inputs:
            return
        self._commands.take(self._source, out=inputs, mode="clip")
        np.subtract(inputs, self._input_offset, out=inputs)
        np.divide(inputs, self._input_factor, out=inputs)

    def _prepare_outputs(self, wires: tuple[Wire, ...]) -> None:
        order: dict[Quantity, int] = {q: i for i, q in enumerate(OUTPUT_QUANTITIES)}
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
