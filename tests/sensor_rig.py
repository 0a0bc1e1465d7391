"""A rig for the sensor FMUs: samples of a drive that never was, instances, and the oracle beside.

The oracle is the ONNX block of the loop, fed with the samples that the FMU's documentation says it
takes; time is counted in fractions, so that nothing of the FMU's own arithmetic is repeated.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from fmu_face import Face

from sensor.carried.runtime import CarriedSensor
from sensor.channels import CHANNEL_NAMES, COMMANDS, OUTPUT_NAMES
from sensor.estimators import open_network
from sensor.missing import HeldSamples

Array = npt.NDArray[np.float64]
PERIOD = Fraction(1, 100)
TOLERANCE = 1e-5  # m/s
COMMAND_NAMES = tuple(command.name for command in COMMANDS)
DEVIATION_NAMES = tuple(name.replace("VRel.", "VRel.Deviation.") for name in OUTPUT_NAMES)
_MEAN = np.array([0.3, -0.2, 0.1, 0.0, 0.0, 0.05, 18.0, 0.01, 0.01, 18.1, 18.2, 18.0, 17.9, 0.1])
_SPREAD = np.array([0.8, 1, 1, *3 * (0.05,), 0.1, 0.02, 0.02, *4 * (0.1,), 0.3])
PASSIVE = 0.3  # start value of the commands


@cache
def signal(count: int, seed: int = 5) -> tuple[Array, Array]:
    """Channels (count, 14) and commands (count, 4), each row for one step of a master."""
    random = np.random.default_rng(seed)
    white = random.standard_normal((count + 2, len(CHANNEL_NAMES)))
    channels = _MEAN + _SPREAD * (white[2:] + white[1:-1] + white[:-2]) / np.sqrt(3)
    return channels, np.repeat(random.random((count // 4 + 1, 4)), 4, axis=0)[:count]


@dataclass(frozen=True)
class Outputs:
    """After each step: estimates and deviations (steps, 4), whether they count, samples missed."""

    estimates: Array
    deviations: Array
    valid: npt.NDArray[np.bool_]
    missed: Array


def expected(network: Path, step: Fraction, channels: Array, commands: Array) -> Outputs:
    """What the FMU of a network should answer to a master's steps from t = 0, with its inputs held
    over each.
    """
    block = open_network(network)
    estimator = HeldSamples(block) if isinstance(block, CarriedSensor) else block
    n = len(channels)
    found = Outputs(np.zeros((n, 4)), np.zeros((n, 4)), np.zeros(n, np.bool_), np.zeros(n))
    estimate, deviation, valid, sample, missed = np.zeros(4), np.zeros(4), False, 0, 0
    before = np.full(4, PASSIVE)
    for k in range(n):
        taken = 0
        while sample * PERIOD < (k + 1) * step:
            at_begin = sample * PERIOD == k * step
            complete = bool(np.isfinite(channels[k]).all())
            if complete or estimator is not block:
                counts = estimator.step(channels[k], before if at_begin else commands[k])
                valid = counts and complete
            else:
                block.reset()  # a window starts anew
                valid = False
            if valid:
                estimate, deviation = estimator.estimate.copy(), estimator.deviation.copy()
            sample, taken = sample + 1, taken + 1
        missed += max(taken - 1, 0)
        before = commands[k]
        found.estimates[k], found.valid[k], found.missed[k] = estimate, valid, missed
        found.deviations[k] = np.nan_to_num(deviation)
    return found


class Sensor(Face):
    """An instance of a packed sensor FMU."""

    def __init__(self, folder: Path, **options: Any) -> None:
        super().__init__(folder, **options)
        self.commanded = COMMAND_NAMES[0] in self.variables
        inputs = (*CHANNEL_NAMES, *(COMMAND_NAMES if self.commanded else ()))
        self._references = (ctypes.c_uint * len(inputs))(
            *(self.variables[name].valueReference for name in inputs)
        )
        self._held = (ctypes.c_double * len(inputs))()
        deviations = DEVIATION_NAMES if self.commanded else ()
        outputs = (*OUTPUT_NAMES, *deviations, "Sensor.MissedSamples")
        self._outputs = [self.variables[name].valueReference for name in outputs]

    def start(self, stop: float | None = None) -> Sensor:
        """Ready for steps, with start values."""
        self.enter(stop)
        self.fmu.exitInitializationMode()
        return self

    def feed(self, channels: Sequence[float], command: Sequence[float]) -> None:
        """Set the inputs."""
        self._held[:] = [*channels, *(command if self.commanded else ())]
        setter = "SetReal" if self.version == 2 else "SetFloat64"
        size = len(self._held)
        assert self.call(setter, *self.sized(self._references, size, self._held)) == 0

    def read(self) -> list[float]:
        """All real outputs."""
        get = self.fmu.getReal if self.version == 2 else self.fmu.getFloat64
        return [float(value) for value in get(self._outputs)]

    def follow(self, step: float, channels: Array, commands: Array, first: int = 0) -> Outputs:
        """Steps of a master that counts k * step, from step `first` on."""
        n = len(channels)
        found = Outputs(np.zeros((n, 4)), np.zeros((n, 4)), np.zeros(n, np.bool_), np.zeros(n))
        for k in range(n):
            self.feed(channels[k], commands[k])
            self.step(first + k, step)
            outputs = self.read()
            found.estimates[k], found.valid[k] = outputs[:4], self["Sensor.Valid"]
            found.missed[k] = outputs[-1]
            if self.commanded:
                found.deviations[k] = outputs[4:8]
        return found

    def drive(self, first: int, last: int, side: float = 1.0) -> list[tuple[float, ...]]:
        """All outputs after each of the steps `first` to `last` - 1 of 10 ms."""
        channels, commands = signal(400)
        rows = []
        for k in range(first, last):
            self.feed(side * channels[k], commands[k])
            self.step(k, 0.01)
            rows.append((*self.read(), float(self["Sensor.Valid"])))
        return rows


def same(found: Outputs, wanted: Outputs) -> None:
    """Fail unless two runs agree to rounding."""
    np.testing.assert_array_equal(found.valid, wanted.valid)
    np.testing.assert_array_equal(found.missed, wanted.missed)
    np.testing.assert_allclose(found.estimates, wanted.estimates, rtol=0.0, atol=TOLERANCE)
    np.testing.assert_allclose(found.deviations, wanted.deviations, rtol=0.0, atol=TOLERANCE)
