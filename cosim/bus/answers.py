"""The answers of the sensor as they come to the bench: late, in part, or not at all."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from cosim.bus.codec import ANSWERED, age_ms, from_sensor
from cosim.bus.durations import Durations
from cosim.bus.messages import AGE_OF_ANSWER, COUNTER, VALID
from cosim.bus.samples import MODULO

Array: TypeAlias = npt.NDArray[np.float64]

REMEMBERED: Final = 1000  # samples for which a late answer is still told from a stray frame


@dataclass
class Answer:
    """The answer to a sample as far as it came: `values` (8,) as `codec.ANSWERED`, SI units, and
    the identifiers of the frames that are missing. `sent` is the clock's time of the sample [s].
    """

    number: int
    sent: float
    values: Array
    missing: set[int]
    valid: bool = True
    age_ms: float = 0.0

    @property
    def whole(self) -> bool:
        """Whether all of it came."""
        return not self.missing


@dataclass
class Answers:
    """Keeps the answers that are to come. `newest` is the latest whole one."""

    newest: Answer | None = None
    whole: int = 0
    unanswered: int = 0
    frames_lost: int = 0
    latency: Durations = field(default_factory=Durations)
    age: Durations = field(default_factory=Durations)

    def __post_init__(self) -> None:
        self._frames = from_sensor()
        self._open: dict[int, Answer] = {}

    def expect(self, number: int) -> Answer:
        """Remember sample `number`, which is sent now; give up the one that is too long ago."""
        values = np.full(len(ANSWERED), np.nan)
        answer = Answer(number, time.time(), values, set(self._frames.identifiers))
        self._open[number % MODULO] = answer
        if len(self._open) > REMEMBERED:
            self._give_up(next(iter(self._open)))
        return answer

    def take(self, identifier: int, data: bytes, stamp: float) -> None:
        """Take a frame; `stamp` is when it came by its driver [s]. Others than answers are left."""
        if identifier not in self._frames.identifiers:
            return
        values = np.full(len(ANSWERED), np.nan)
        try:
            beside = self._frames.decode(identifier, data, values)
        except ValueError:
            return  # as good as lost
        answer = self._open.get(beside[COUNTER.name])
        if answer is None or identifier not in answer.missing:
            return
        np.copyto(answer.values, values, where=np.isfinite(values))
        answer.missing.discard(identifier)
        if VALID.name in beside:
            answer.valid = answer.valid and bool(beside[VALID.name])
            answer.age_ms = max(answer.age_ms, age_ms(beside[AGE_OF_ANSWER.name]))
        if answer.whole:
            self._finish(answer, stamp)

    def settle(self) -> None:
        """Give up what has not come until now."""
        for counter in list(self._open):
            self._give_up(counter)

    def _finish(self, answer: Answer, stamp: float) -> None:
        del self._open[answer.number % MODULO]
        now = time.time()
        # Some drivers count their stamps from another zero than the clock.
        came = stamp if answer.sent <= stamp <= now else now
        self.latency.add(1e3 * max(came - answer.sent, 0.0))
        self.age.add(answer.age_ms)
        self.whole += 1
        if self.newest is None or answer.number > self.newest.number:
            self.newest = answer

    def _give_up(self, counter: int) -> None:
        answer = self._open.pop(counter)
        self.unanswered += 1
        if len(answer.missing) < len(self._frames.identifiers):
            self.frames_lost += len(answer.missing)
