"""Frames put together to samples at the sensor: in whatever order they come, and with gaps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
import numpy.typing as npt

from cosim.bus.codec import GIVEN, FrameSet, to_sensor
from cosim.bus.messages import COUNTER
from sensor.channels import CHANNELS, SAMPLE_RATE_HZ

Array: TypeAlias = npt.NDArray[np.float64]

MODULO: Final = 1 << 16
LONGEST_GAP: Final = SAMPLE_RATE_HZ
"""Samples without a frame after which the next one is a fresh start."""


@dataclass(frozen=True)
class Sample:
    """One sample as far as it came. `channels` (14,) and `command` (4,) are SI, NaN where missing.

    `arrived` is the time of its first frame [s], None where no frame came: such a sample only keeps
    the estimator in step. `fresh`: what came before is too long ago.
    """

    counter: int
    channels: Array
    command: Array
    arrived: float | None
    fresh: bool = False


class Samples:
    """Puts frames together. A sample is due when it is whole, when frames of a later one come, or
    `patience_s` after its first frame.

    `frames_lost` counts frames that were not there when their sample was due, `frames_late` those
    of them that came after all: too late is lost.
    """

    def __init__(self, patience_s: float) -> None:
        self._frames: FrameSet = to_sensor()
        self._patience = patience_s
        self.reset()

    def reset(self, from_zero: bool = False) -> None:
        """Begin again, with sample 0 or with any."""
        self.frames_lost = self.frames_late = 0
        self._counter: int | None = MODULO - 1 if from_zero else None
        self._due = True  # nothing is being put together
        self._begin(0, None)

    def take(self, identifier: int, data: bytes, now: float) -> list[Sample]:
        """Take a frame at time `now` [s]; return the samples that are due."""
        if identifier not in self._frames.identifiers:
            return []
        values = np.full(len(GIVEN), np.nan)
        try:
            counter = self._frames.decode(identifier, data, values)[COUNTER.name]
        except ValueError:
            return []  # its frame will be missed
        due: list[Sample] = []
        ahead = 1 if self._counter is None else _ahead(counter, self._counter)
        if ahead > 0:
            due += self._moved_on(counter, ahead, now)
        elif ahead < 0 or self._due:
            self.frames_late += 1
            return []
        there = np.isfinite(values)
        np.copyto(self._values, values, where=there)
        self._missing.discard(identifier)
        if not self._missing:
            due.append(self._finished())
        return due

    def waiting_s(self, now: float) -> float | None:
        """Return how long to wait for the rest of a sample [s], None where none has begun."""
        if self._due or self._arrived is None:
            return None
        return max(self._arrived + self._patience - now, 0.0)

    def expire(self, now: float) -> list[Sample]:
        """Return the sample whose frames have not all come in time, if there is one."""
        if self.waiting_s(now) != 0.0:
            return []
        self.frames_lost += len(self._missing)
        return [self._finished()]

    def _moved_on(self, counter: int, ahead: int, now: float) -> list[Sample]:
        """Return what is due because frames of sample `counter` come, and begin that."""
        due: list[Sample] = []
        if not self._due:
            self.frames_lost += len(self._missing)
            due.append(self._finished())
        first = self._counter is None
        skipped = 0 if first else ahead - 1
        self.frames_lost += skipped * len(self._frames.identifiers)
        fresh = skipped > LONGEST_GAP
        for i in range(0 if fresh else skipped):
            self._begin((counter - skipped + i) % MODULO, None)
            due.append(self._finished())
        self._begin(counter, now)
        self._fresh = fresh
        return due

    def _begin(self, counter: int, now: float | None) -> None:
        self._values = np.full(len(GIVEN), np.nan)
        self._missing = set(self._frames.identifiers)
        self._arrived = now
        self._fresh = False
        if now is not None:
            self._counter, self._due = counter, False
        self._number = counter

    def _finished(self) -> Sample:
        self._due = True
        channels, command = np.split(self._values, [len(CHANNELS)])
        return Sample(self._number, channels, command, self._arrived, self._fresh)


def _ahead(counter: int, other: int) -> int:
    """Return how many samples `counter` is ahead of `other`, modulo the counter's range."""
    return (counter - other + MODULO // 2) % MODULO - MODULO // 2
