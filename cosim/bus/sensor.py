"""The bench's end of the bus: a block of the loop whose sensor is somewhere else."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from cosim.bus.answers import Answer, Answers
from cosim.bus.codec import to_sensor
from cosim.bus.messages import COUNTER
from cosim.bus.samples import MODULO
from cosim.bus.session import MOST_FRAMES, REPEAT_S, Session
from cosim.bus.transport import Address, Link
from cosim.errors import BusError
from sensor.channels import CHANNELS, OUTPUTS

if TYPE_CHECKING:
    import can

    from cosim.bus.process import NodeProcess

Array: TypeAlias = npt.NDArray[np.float64]

SILENCE_S: Final = 2.0
"""Time waited in vain after which the bench waits no more until the sensor is heard again."""
GOODBYE_S: Final = 5.0  # for a sensor that was heard, and may still have a queue to work off


@dataclass(frozen=True)
class Waiting:
    """How long the bench waits for the answer to a sample, how old an estimate may be that counts
    [samples], and how long it waits for a sensor before the first sample.
    """

    deadline_s: float
    oldest_samples: int
    connect_s: float


class BusSensor:
    """A sensor behind a bus: sends each sample, waits for its answer until the deadline.

    `estimate` and `deviation` (4,) [m/s] are those of the newest answer where that is no older than
    it may be, else NaN. `open` comes before the first step, `close` after the last. `fingerprint`
    is that of the estimator which must be there, 0 for any; `process` is the sensor's process where
    it belongs to the run.
    """

    def __init__(
        self,
        address: Address,
        waiting: Waiting,
        fingerprint: int = 0,
        process: NodeProcess | None = None,
    ) -> None:
        self.estimate = np.full(len(OUTPUTS), np.nan)
        self.deviation = np.full(len(OUTPUTS), np.nan)
        self._address = address
        self._waiting = waiting
        self._fingerprint = fingerprint
        self._process = process
        self._frames = to_sensor()
        self._given = np.zeros(len(self._frames.step))
        self._answers = Answers()
        self._samples = self._in_time = 0
        self._in_vain_s = 0.0
        self._lost_to_sensor: int | None = None
        self._open: tuple[Link, Session] | None = None

    def open(self) -> None:
        """Find the sensor; raises `BusError` where none answers, or the wrong one."""
        link = Link(self._address)
        session = Session(link, self._take)
        self._open = (link, session)
        try:
            if self._process is not None:
                self._process.start()
            told = session.begin(self._waiting.connect_s, self._last_words)
        except BaseException:
            self.close()
            raise
        if told and self._fingerprint and told != self._fingerprint:
            self.close()
            raise BusError(
                f"the sensor on bus {self._address} runs another estimator than the scenario names"
            )

    def step(self, measured: Array, command: Array) -> bool:
        """Send the channels (14,) and the damper command (4,) held until now; return whether there
        is an estimate that counts. Raises `BusError` where the bus fails, or the run's own sensor.
        """
        if self._open is None:
            raise BusError(f"bus {self._address} is not open")
        link, number = self._open[0], self._samples
        self._samples += 1
        self._given[: len(CHANNELS)] = measured
        self._given[len(CHANNELS) :] = command
        begin = time.perf_counter()
        answer = self._answers.expect(number)
        for frame in self._frames.encode(self._given, **{COUNTER.name: number % MODULO}):
            link.send(frame)
        self._wait_for(link, answer, begin)
        return self._use(number)

    def close(self) -> None:
        """Say the end of the run on the bus, and end the sensor's process if it is the run's."""
        if self._open is None:
            return
        link, session = self._open
        try:
            if self._samples:
                patient = self._in_vain_s < SILENCE_S
                self._lost_to_sensor = session.end(GOODBYE_S if patient else REPEAT_S)
        finally:
            self._open = None
            link.close()
            if self._process is not None:
                self._process.stop(self._lost_to_sensor is not None)
            self._answers.settle()

    def figures(self) -> dict[str, float]:
        """Return the figures of the run by the names of `cosim.metrics.BUS_FIGURES`; those on lost
        frames are not there if the sensor did not tell at the end.
        """
        answers = self._answers
        found: dict[str, float] = {
            "samples": self._samples,
            "answers_in_time": self._in_time,
            "late_answers": answers.whole - self._in_time,
            "unanswered_samples": answers.unanswered,
            "values_out_of_range": self._frames.out_of_range,
            **answers.latency.figures("latency"),
            **answers.age.figures("age"),
        }
        if self._lost_to_sensor is not None:
            found["frames_lost_to_sensor"] = self._lost_to_sensor
            found["frames_lost_from_sensor"] = answers.frames_lost
            found["frames_lost"] = self._lost_to_sensor + answers.frames_lost
        return found

    def _last_words(self) -> str | None:
        return None if self._process is None else self._process.last_words()

    def _take(self, message: can.Message) -> None:
        assert self._open is not None
        self._open[1].check_alone(message)
        self._answers.take(message.arbitration_id, bytes(message.data), message.timestamp)

    def _wait_for(self, link: Link, answer: Answer, begin: float) -> None:
        patient = self._in_vain_s < SILENCE_S
        end = begin + (self._waiting.deadline_s if patient else 0.0)
        for _ in range(MOST_FRAMES):
            message = link.receive(max(end - time.perf_counter(), 0.0))
            if message is None:
                break
            heard = self._answers.whole
            self._take(message)
            if self._answers.whole > heard:
                self._in_vain_s = 0.0
            if answer.whole:
                self._in_time += 1
                return
        self._in_vain_s += time.perf_counter() - begin
        self._check_process()

    def _check_process(self) -> None:
        """Raise `BusError` where the run's own sensor has ended; another's may come back."""
        if (words := self._last_words()) is not None:
            self._in_vain_s = SILENCE_S  # nobody is there to say goodbye to
            raise BusError(f"the sensor on bus {self._address} has ended: {words}")

    def _use(self, number: int) -> bool:
        """Take over the newest estimate if it counts for sample `number`."""
        newest = self._answers.newest
        if newest is not None and newest.valid:
            self.estimate[:] = newest.values[: len(OUTPUTS)]
            self.deviation[:] = newest.values[len(OUTPUTS) :]
            fresh = number - newest.number <= self._waiting.oldest_samples
            if fresh and np.isfinite(self.estimate).all():
                return True
        self.estimate.fill(np.nan)
        self.deviation.fill(np.nan)
        return False
