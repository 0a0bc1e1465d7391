"""The sensor's end of the bus: samples in, estimates out, in whatever process it runs."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from cosim.bus.codec import ANSWERED, answer_signals, decode_one, encode_one, from_sensor
from cosim.bus.durations import Durations
from cosim.bus.messages import CONTROL, END, START, STATUS
from cosim.bus.samples import Sample, Samples
from cosim.bus.transport import Link
from sensor.channels import COMMANDS
from sensor.estimator import Estimator
from sensor.missing import HeldSamples

Array: TypeAlias = npt.NDArray[np.float64]

POLL_S: Final = 0.1  # how often a node that hears nothing looks whether it shall end
LARGEST_COUNT: Final = 0xFFFF


@dataclass
class Counts:
    """What a node has done; durations in ms. `frames_late` of `frames_lost` came after all."""

    runs: int = 0
    samples: int = 0
    incomplete_samples: int = 0
    estimates: int = 0
    frames_lost: int = 0
    frames_late: int = 0
    fresh_starts: int = 0
    age: Durations = field(default_factory=Durations)
    estimation: Durations = field(default_factory=Durations)

    def as_dict(self) -> dict[str, int | float]:
        """Return the figures by name."""
        counted = {name: value for name, value in vars(self).items() if isinstance(value, int)}
        return {
            **counted,
            **self.age.figures("age"),
            **self.estimation.figures("estimation"),
        }


@dataclass(frozen=True)
class Ending:
    """When a node ends by itself: after so many runs, or after a silence of so many seconds."""

    runs: int | None = None
    idle_s: float | None = None


class SensorNode:
    """An estimator on a bus. Every sample that is due is estimated and answered; channels that did
    not come are bridged by `sensor.missing.HeldSamples`, a missing command by the one before.

    `fingerprint` tells the bench which estimator this is, 0 tells it nothing.
    """

    def __init__(
        self, link: Link, estimator: Estimator, fingerprint: int, patience_s: float
    ) -> None:
        self.counts = Counts()
        self._link = link
        self._estimator = HeldSamples(estimator)
        self._fingerprint = fingerprint
        self._samples = Samples(patience_s)
        self._answers = from_sensor()
        self._answer = np.full(len(ANSWERED), np.nan)
        self._command = np.zeros(len(COMMANDS))
        self._session: int | None = None
        self._ended = True

    def run(self, ending: Ending, stopped: Callable[[], bool]) -> None:
        """Answer until `stopped` says so, or until `ending`."""
        heard = time.perf_counter()
        while not stopped():
            now = time.perf_counter()
            wait = self._samples.waiting_s(now)
            message = self._link.receive(POLL_S if wait is None else min(wait, POLL_S))
            now = time.perf_counter()
            if message is None:
                due = self._samples.expire(now)
            elif message.arbitration_id == CONTROL.identifier:
                heard, due = now, []
                self._controlled(bytes(message.data))
            else:
                due = self._samples.take(message.arbitration_id, bytes(message.data), now)
                heard = now if due else heard
            for sample in due:
                self._work(sample)
            if ending.runs is not None and self.counts.runs >= ending.runs:
                break
            if ending.idle_s is not None and now - heard > ending.idle_s:
                break
        self._collect()

    def _controlled(self, data: bytes) -> None:
        told = decode_one(CONTROL, data)
        if told is None:
            return
        session, command = told["Session"], told["Command"]
        if command == START and session != self._session:
            self._collect()
            self._session, self._ended = session, False
            self._samples.reset(from_zero=True)
            self._forget()
        if command == END and session == self._session and not self._ended:
            self._ended = True
            self.counts.runs += 1
        if session == self._session:
            lost = min(self._samples.frames_lost, LARGEST_COUNT)
            status = {"Session": session, "FramesLost": lost, "Fingerprint": self._fingerprint}
            self._link.send(encode_one(STATUS, **status))

    def _collect(self) -> None:
        """Add what the present run has lost."""
        self.counts.frames_lost += self._samples.frames_lost
        self.counts.frames_late += self._samples.frames_late
        self._samples.frames_lost = self._samples.frames_late = 0

    def _forget(self) -> None:
        self._estimator.reset()
        self._command.fill(0.0)

    def _work(self, sample: Sample) -> None:
        """Estimate one sample, and answer if anything of it came."""
        if sample.fresh:
            self.counts.fresh_starts += 1
            self._forget()
        np.copyto(self._command, sample.command, where=np.isfinite(sample.command))
        begin = time.perf_counter()
        valid = self._estimator.step(sample.channels, self._command)
        end = time.perf_counter()
        if sample.arrived is None:
            return
        self.counts.samples += 1
        self.counts.estimates += int(valid)
        self.counts.incomplete_samples += int(self._estimator.missing.any())
        self.counts.estimation.add(1e3 * (end - begin))
        self._send(sample, valid)

    def _send(self, sample: Sample, valid: bool) -> None:
        assert sample.arrived is not None
        velocities = len(self._estimator.estimate)
        self._answer[:velocities] = self._estimator.estimate
        self._answer[velocities:] = self._estimator.deviation
        age = 1e3 * (time.perf_counter() - sample.arrived)
        self.counts.age.add(age)
        beside = answer_signals(sample.counter, age, valid)
        for frame in self._answers.encode(self._answer, **beside):
            self._link.send(frame)
