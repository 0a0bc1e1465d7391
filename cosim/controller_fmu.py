"""The controller block that is an FMU: any co-simulation FMU with four damper commands as outputs.

Time: the FMU is initialised at t_0 with the sample of t_0 and asked for its outputs; at every later
t_k it is given the sample of t_k and stepped from t_k-1 to t_k. So its clock is the car's, and what
it answers to the sample of t_k is held by the dampers from t_k on, as with the project's own laws:
there is no sample of delay, and none gained either. A law without a memory, whose outputs follow
from its inputs at once, commands what it would as a law of this project. One with a state sees the
sample of t_k held over [t_k-1, t_k], as in backward Euler integration. One that samples by a
clock of its own finds the sample of t_k on whichever end of the step its sampling falls.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.control.body import Body
from cosim.control.sample import Sample
from cosim.errors import FmuError
from cosim.fmi import Description, Slave, Value
from cosim.quantities import (
    BODY_ACCELERATION,
    BODY_VELOCITY,
    CHANNEL_QUANTITIES,
    CONTROLLER_INPUTS,
    CONTROLLER_OUTPUTS,
    ESTIMATE,
    ESTIMATE_DEVIATION,
)
from cosim.wiring import Wiring
from sensor.channels import SAMPLE_RATE_HZ

Array = npt.NDArray[np.float64]

STEP_S: Final = 1 / SAMPLE_RATE_HZ
ROUNDING: Final = 1e-9  # by which a command may miss 0..1; it counts as the end that it misses
_REALS: Final = tuple(q for q in CONTROLLER_INPUTS if not q.boolean)


class FmuController:
    """A controller FMU, FMI 2.0 or 3.0; `wiring` is that of `cosim.control.from_fmu`.

    It is given what a law of the project is given, in the FMU's own units. `on_truth` decides
    whether the suspension velocities are the true or the estimated ones. While an estimate is not
    valid the velocities keep their last values, 0 before the first, so that no input is ever NaN;
    the deviations, too, which are 0 on the truth and of an estimator that expects none. An FMU that
    takes `Sensor.Valid` decides itself what to do then. Of another one the last command stays,
    `initial` before there was one, while its own clock goes on.

    `command` (4,) is the same array at every step. A call that fails and a command beyond 0..1
    raise `FmuError`.
    """

    def __init__(
        self,
        description: Description,
        wiring: Wiring,
        start_values: Mapping[str, Value],
        on_truth: bool,
        initial: float = 0.0,
    ) -> None:
        self.command: Array = np.full(len(CONTROLLER_OUTPUTS), initial)
        self._description, self._wiring = description, wiring
        self._start_values = dict(start_values)
        self._on_truth, self._count = on_truth, 0
        self._slave: Slave | None = None
        self._found: Array = np.zeros(len(CONTROLLER_OUTPUTS))
        self._prepare()

    @property
    def path(self) -> Path:
        """The FMU's file."""
        return self._description.path

    def connect(self) -> None:
        """Load the FMU, a fresh instance; raises `FmuError` where it does not load."""
        self._slave = Slave(
            self._description,
            [wire.variable for wire in self._reals],
            [wire.variable for wire in self._wiring.outputs],
            input_flags=[wire.variable for wire in self._flags],
        )
        self._count = 0

    def step(self, sample: Sample) -> Array:
        """Return the commands (4,), 0 soft to 1 hard, from what is known at t_k."""
        slave, k = self._slave, self._count
        if slave is None:
            raise RuntimeError("connect comes before the first step")
        valid = self._on_truth or sample.valid
        self._know(sample, valid)
        self._known.take(self._source, out=slave.inputs, mode="clip")
        np.subtract(slave.inputs, self._input_offset, out=slave.inputs)
        np.divide(slave.inputs, self._input_factor, out=slave.inputs)
        slave.input_flags.fill(valid)
        if k == 0:
            slave.initialise(self._start_values)
        else:
            slave.step(k - 1, STEP_S)
        slave.read()
        if valid or self._flags:
            self._take_command(slave)
        self._count = k + 1
        return self.command

    def close(self) -> None:
        """Free the FMU; may be called twice, and without `connect`."""
        if self._slave is not None:
            self._slave.close()
            self._slave = None

    def _know(self, sample: Sample, valid: bool) -> None:
        """Bring what is known up to date."""
        self._channels[:] = sample.measured
        if self._body is not None:
            self._body.step(sample.measured)
            self._velocity[:] = self._body.velocity
            self._acceleration[:] = self._body.acceleration
        if self._on_truth:
            self._relative[:] = sample.truth
        elif valid:
            self._relative[:] = sample.estimate
            self._deviation[:] = sample.deviation
            np.isnan(self._deviation, out=self._unexpected)
            np.copyto(self._deviation, 0.0, where=self._unexpected)

    def _take_command(self, slave: Slave) -> None:
        """Take the outputs as commands; raises `FmuError` naming the first that is none."""
        found = self._found
        np.multiply(slave.outputs, self._output_factor, out=found)
        np.add(found, self._output_offset, out=found)
        if not (found.min() >= -ROUNDING and found.max() <= 1.0 + ROUNDING):  # NaN is neither
            for wire, value in zip(self._wiring.outputs, found.tolist(), strict=True):
                if not -ROUNDING <= value <= 1.0 + ROUNDING:
                    raise FmuError(
                        f"{self.path.name}: {wire.variable} makes "
                        f"{wire.quantity.name} {value:.6g} at t = {self._count * STEP_S:.6g} s, "
                        "where a damper command of 0, soft, to 1, hard, belongs; the last inputs "
                        f"were {slave.held}"
                    )
        np.clip(found, 0.0, 1.0, out=self.command)

    def _prepare(self) -> None:
        """Lay out the buffers: what is known, by quantity, and its parts."""
        self._reals = tuple(wire for wire in self._wiring.inputs if not wire.quantity.boolean)
        self._flags = tuple(wire for wire in self._wiring.inputs if wire.quantity.boolean)
        self._known: Array = np.zeros(len(_REALS))
        parts = (CHANNEL_QUANTITIES, ESTIMATE, ESTIMATE_DEVIATION, BODY_VELOCITY, BODY_ACCELERATION)
        ends = np.cumsum([len(part) for part in parts])[:-1]
        views = np.split(self._known, ends)
        self._channels, self._relative, self._deviation, self._velocity, self._acceleration = views
        self._unexpected = np.zeros(len(ESTIMATE_DEVIATION), dtype=np.bool_)
        place = {quantity.name: i for i, quantity in enumerate(_REALS)}
        names = [wire.quantity.name for wire in self._reals]
        moving = {quantity.name for quantity in (*BODY_VELOCITY, *BODY_ACCELERATION)}
        self._body = Body() if moving & set(names) else None
        self._source = np.array([place[name] for name in names], dtype=np.intp)
        self._input_factor = np.array([wire.factor for wire in self._reals])
        self._input_offset = np.array([wire.offset for wire in self._reals])
        self._output_factor = np.array([wire.factor for wire in self._wiring.outputs])
        self._output_offset = np.array([wire.offset for wire in self._wiring.outputs])
