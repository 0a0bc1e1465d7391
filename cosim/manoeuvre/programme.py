"""Steering and pedals that a manoeuvre prescribes, laid over the driver's own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.driver import VX, PathDriver
from cosim.driver_model import DriverModel
from cosim.testbench import State

Array = npt.NDArray[np.float64]

REST_S = 1.0  # the pedal is held so long after the car has come to rest


class Programme(Protocol):
    """Overrides parts of a command. `begin` is its first step, -1 before."""

    begin: int
    finished: bool

    def apply(self, k: int, s: float, v: float, command: Array) -> None:
        """Change `command` (3,) in place: steering-wheel angle [rad], accelerator, brake; the car
        is at `s` [m] with `v` [m/s].
        """


class ProgrammedDriver:
    """A driver who keeps to his line and speed until a programme takes over."""

    def __init__(self, driver: PathDriver, programme: Programme) -> None:
        self._driver, self._programme = driver, programme
        self.finished = False
        self.command = driver.command

    @property
    def completed(self) -> bool:
        """Whether the programme has come to its end."""
        return self._programme.finished

    @property
    def largest_deviation(self) -> float:
        """Largest distance from the line while the driver steered [m]."""
        return self._driver.largest_deviation

    def step(self, k: int, state: State) -> Array:
        """Return the commands for [t_k, t_k+1]."""
        self._driver.step(k, state)
        self._programme.apply(k, self._driver.s, float(state.channels[VX]), self.command)
        self.finished = self._programme.finished or self._driver.finished
        return self.command


class Steering:
    """Steering-wheel angle over time [rad], from `start` [m] on for `duration` [s].

    The accelerator is released `coast` [s] of driving before, or held where it is (None).
    """

    def __init__(
        self,
        angle: Callable[[float], float],
        start: float,
        duration: float,
        coast: float | None,
        step_s: float,
    ) -> None:
        self.begin = -1
        self.finished = False
        self._angle, self._start, self._duration = angle, start, duration
        self._coast, self._h = coast, step_s
        self._straight = 0.0  # angle of driving straight on, before
        self._gas: float | None = None

    def apply(self, k: int, s: float, v: float, command: Array) -> None:
        """Override the angle from the beginning on, and the pedals."""
        if self._gas is None and s >= self._start - v * (self._coast or 0.0):
            self._gas = 0.0 if self._coast is not None else float(command[1])
        if self._gas is not None:
            command[1], command[2] = self._gas, 0.0
        if self.begin < 0 and s >= self._start:
            self.begin, self._straight = k, float(command[0])
        if self.begin >= 0:
            time = (k - self.begin) * self._h
            command[0] = self._straight + self._angle(time)
            self.finished = time >= self._duration


class Coasting:
    """No pedal from `start` to `end` [m]."""

    def __init__(self, start: float, end: float) -> None:
        self.begin = -1
        self.finished = False
        self._start, self._end = start, end

    def apply(self, k: int, s: float, v: float, command: Array) -> None:
        """Release the pedals."""
        if self.begin < 0 and s >= self._start:
            self.begin = k
        if self.begin >= 0:
            command[1:] = 0.0
            self.finished = s >= self._end


class Pedals:
    """A pedal (negative: brake) or an acceleration [m/s2] from `start` [m] on, to the speed `end`
    [m/s].

    The acceleration is held by the driver's model of his car and a correction of the speed.
    """

    def __init__(
        self,
        start: float,
        end: float,
        step_s: float,
        pedal: float | None = None,
        acceleration: float | None = None,
    ) -> None:
        self.begin = -1
        self.finished = False
        self._start, self._end, self._h = start, end, step_s
        self._pedal, self._acceleration = pedal, acceleration
        self._model = DriverModel()
        self._from = 0.0
        self._rest = 0
        self._held = np.zeros(2)

    def apply(self, k: int, s: float, v: float, command: Array) -> None:
        """Override both pedals from the beginning on."""
        if self.begin < 0 and s >= self._start:
            self.begin, self._from = k, v
        if self.begin < 0:
            return
        if self._end > 0.0 or v > 0.3:  # below, the pedal stays as it is until the car rests
            self._held[:] = self._demand(k, v)
        command[1:] = self._held
        if self._end > 0.0:
            self.finished = v <= self._end if self._slows else v >= self._end
        else:
            self._rest += v < 0.05
            self.finished = self._rest * self._h >= REST_S

    @property
    def _slows(self) -> bool:
        return (self._pedal if self._pedal is not None else self._acceleration or 0.0) < 0.0

    def _demand(self, k: int, v: float) -> tuple[float, float]:
        if self._pedal is not None:
            return max(self._pedal, 0.0), max(-self._pedal, 0.0)
        m, wanted = self._model, self._acceleration or 0.0
        error = self._from + wanted * (k - self.begin) * self._h - v
        return m.pedals(m.mass * (wanted + 2 * m.speed_gain * error) + m.resistance(v, 0.0), v)
