"""The sensor block that is an FMU: what `cosim pack` makes, or another with these variables."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.errors import FmuError, did_you_mean
from cosim.fmi import KINDS, Description, Slave
from cosim.quantities import SENSOR_VALID
from sensor.channels import CHANNELS, COMMANDS, OUTPUTS, SAMPLE_RATE_HZ, Channel
from sensor.estimator import sample_by_sample

Array = npt.NDArray[np.float64]

STEP_S: Final = 1 / SAMPLE_RATE_HZ
VALID: Final = SENSOR_VALID.name
DEVIATIONS: Final = tuple(o.name.replace("VRel.", "VRel.Deviation.") for o in OUTPUTS)


class FmuSensor:
    """A sensor FMU, FMI 2.0 or 3.0, as a streaming sensor.

    It has the 14 channels as inputs and `VRel.FL` to `VRel.RR` and the Boolean `Sensor.Valid` as
    outputs; the damper commands and `VRel.Deviation.FL` to `.RR` only if its network has them.
    `estimate` and `deviation` (4,) [m/s] are the same arrays at every step, NaN while not valid.
    A channel that is NaN stops nothing: the FMU says when its estimates count again.

    The FMU samples by its own clock, at 0, 10 ms, 20 ms. Its communication points lie halfway
    between, so that the step around a sample holds what was measured at the sample and the damper
    commands that were held until it.
    """

    def __init__(self, path: Path) -> None:
        """Load the FMU; raises `FmuError` if it is none, or lacks a variable of a sensor."""
        description = Description(path)
        _check(description)
        known = description.variables
        commands = COMMANDS if COMMANDS[0].name in known else ()
        deviations = DEVIATIONS if DEVIATIONS[0] in known else ()
        inputs = [channel.name for channel in (*CHANNELS, *commands)]
        outputs = [*(output.name for output in OUTPUTS), *deviations]
        self._slave = Slave(description, inputs, outputs, flags=[VALID])
        self._measured = self._slave.inputs[: len(CHANNELS)]
        self._commands = self._slave.inputs[len(CHANNELS) :]
        self._estimate = self._slave.outputs[: len(OUTPUTS)]
        self._deviation = self._slave.outputs[len(OUTPUTS) :]
        self._count = 0
        self.estimate: Array = np.full(len(OUTPUTS), np.nan)
        self.deviation: Array = np.full(len(OUTPUTS), np.nan)

    def reset(self) -> None:
        """Forget all samples."""
        if self._count:
            self._slave.reset()
        self._count = 0
        self.estimate.fill(np.nan)
        self.deviation.fill(np.nan)

    def step(self, measured: Array, command: Array) -> bool:
        """Take one sample (14,) in SI units and the damper command (4,) held until it; return
        whether the estimate counts. Raises `FmuError` with the FMU's own words.
        """
        slave, k = self._slave, self._count
        self._measured[:] = measured
        if self._commands.size:
            self._commands[:] = command
        if k == 0:
            slave.initialise({})
            slave.advance(0.0, 0.5 * STEP_S)
        else:
            slave.advance((k - 0.5) * STEP_S, STEP_S)
        slave.read()
        self._count = k + 1
        if not slave.flags[0]:
            self.estimate.fill(np.nan)
            self.deviation.fill(np.nan)
            return False
        self.estimate[:] = self._estimate
        if self._deviation.size:
            self.deviation[:] = self._deviation
        return True

    def apply(self, channels: Array, commands: Array) -> Array:
        """Estimate a whole run from a fresh start: (samples, 14), (samples, 4) -> (samples, 4)
        [m/s], NaN until valid; `step`'s state is lost.
        """
        return self.apply_with_deviation(channels, commands)[0]

    def apply_with_deviation(self, channels: Array, commands: Array) -> tuple[Array, Array]:
        """Return estimates and deviations (samples, 4) [m/s] of a whole run, as `apply` does."""
        return sample_by_sample(self, channels, commands)

    def close(self) -> None:
        """Free the FMU; may be called twice."""
        self._slave.close()


def _check(description: Description) -> None:
    """Raise `FmuError` with everything that the FMU lacks of a sensor."""
    problems = [_problem(description, c, "input") for c in CHANNELS]
    problems += [_problem(description, o, "output") for o in OUTPUTS]
    if any(c.name in description.variables for c in COMMANDS):
        problems += [_problem(description, c, "input") for c in COMMANDS]
    valid = description.variables.get(VALID)
    if valid is None or KINDS.get(valid.type) != "Boolean" or valid.causality != "output":
        problems.append(f"it has no Boolean output '{VALID}'")
    found = [problem for problem in problems if problem]
    if found:
        raise FmuError(f"{description.path}: this is no sensor FMU: {'; '.join(found)}")


def _problem(description: Description, channel: Channel, causality: str) -> str:
    """Return what is wrong with one variable, '' if nothing is."""
    variable = description.variables.get(channel.name)
    if variable is None:
        hint = did_you_mean(channel.name, description.variables)
        return f"it has no {causality} '{channel.name}'{hint.rstrip('?')}"
    if variable.causality != causality:
        return f"'{channel.name}' is of causality {variable.causality}, where {causality} belongs"
    unit = description.unit_of(channel.name)
    if unit not in (None, channel.unit):
        return f"'{channel.name}' is in {unit}, where {channel.unit} belongs"
    return ""
