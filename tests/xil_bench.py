"""A car behind a model access port of ASAM XIL, as docs/regression.md shows it, and such a port.

The adapter is written for the interface of the standard. The port has the real vehicle FMU behind
it, so that a whole scenario can be driven through the adapter.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.quantities import INPUT_QUANTITIES, OUTPUT_QUANTITIES
from cosim.testbench import State, Testbench

Array = npt.NDArray[np.float64]


class XilBench:
    """A test bench over an MAPort: `paths` are the variables' names on the bench, by quantity."""

    def __init__(self, port: Any, factory: Any, config: str, paths: Mapping[str, str]) -> None:
        self._port, self._factory, self._config = port, factory, config
        self._outputs = [paths[q.name] for q in OUTPUT_QUANTITIES]
        self._inputs = [paths[q.name] for q in INPUT_QUANTITIES]
        self._values = np.zeros(len(OUTPUT_QUANTITIES))
        self._state = State.over(self._values)

    def connect(self) -> None:
        self._port.Configure(self._port.LoadConfiguration(self._config), True)
        self._port.StartSimulation()

    def read(self) -> State:
        for i, path in enumerate(self._outputs):
            self._values[i] = self._port.Read(path).Value
        return self._state

    def write(self, driver_command: Array, damper_command: Array) -> None:
        for path, value in zip(self._inputs, (*driver_command, *damper_command), strict=True):
            self._port.Write(path, self._factory.CreateFloatValue(float(value)))

    def step(self, k: int) -> None:
        """Wait until the bench, which goes by its own clock, is there."""
        while self._port.Read("Time").Value < (k + 1) * 0.01 - 1e-6:
            pass

    def stop(self) -> None:
        self._port.StopSimulation()
        self._port.Dispose()


class FloatValue:
    """A value of the interface."""

    def __init__(self, value: float) -> None:
        self.Value = value


class ValueFactory:
    """Makes values of the interface."""

    def CreateFloatValue(self, value: float) -> FloatValue:
        return FloatValue(value)


class Port:
    """A port of the interface with a test bench of ours behind it, in which a look at the clock
    takes a hundredth of a second.
    """

    def __init__(self, bench: Testbench) -> None:
        self._bench, self._state = bench, ""
        self._order = {q.name: i for i, q in enumerate(OUTPUT_QUANTITIES)}
        self._inputs = {q.name: i for i, q in enumerate(INPUT_QUANTITIES)}
        self._commands = np.zeros(len(INPUT_QUANTITIES))
        self._outputs: Array = np.zeros(0)
        self._k = 0
        self.calls: list[str] = []

    def LoadConfiguration(self, file: str) -> str:
        self.calls.append("LoadConfiguration")
        return file

    def Configure(self, configuration: str, force: bool) -> None:
        self.calls.append(f"Configure {configuration}")

    def StartSimulation(self) -> None:
        self.calls.append("StartSimulation")
        self._bench.connect()
        self._fetch()

    def StopSimulation(self) -> None:
        self.calls.append("StopSimulation")

    def Dispose(self) -> None:
        self.calls.append("Dispose")
        self._bench.stop()

    def Read(self, name: str) -> FloatValue:
        if name == "Time":
            self._bench.write(self._commands[:3], self._commands[3:])
            self._bench.step(self._k)
            self._k += 1
            self._fetch()
            return FloatValue(self._k * 0.01)
        return FloatValue(float(self._outputs[self._order[name.removeprefix("Model/")]]))

    def Write(self, name: str, value: FloatValue) -> None:
        self._commands[self._inputs[name.removeprefix("Model/")]] = value.Value

    def _fetch(self) -> None:
        state = self._bench.read()
        self._outputs = np.concatenate([state.channels, state.truth, state.recorded])
