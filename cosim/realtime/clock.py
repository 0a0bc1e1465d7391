"""When a sample is due: at once, or at its deadline on the machine's monotonic clock."""

from __future__ import annotations

import gc
import time
from typing import Any, Final

import numpy as np

from cosim.realtime.lateness import histogram, percentiles
from cosim.scenario.real_time import Overrun, RealTime

_MS: Final = 1e-6  # of a nanosecond


class Clock:
    """Every sample is due at once. Keeps how long each took, from its beginning until the next is
    asked for.

    A context manager around the loop; `samples` is how many there are at most.
    """

    stopped = ""  # why the run was stopped, if it was

    def __init__(self, samples: int) -> None:
        self._taken = np.zeros(samples)  # ms
        self._begun = 0
        self._count = 0  # samples that are done

    def __enter__(self) -> Clock:
        return self

    def __exit__(self, *_: object) -> None:
        return

    def wait(self, k: int) -> bool:
        """Return at once; sample k - 1 is done."""
        now = time.monotonic_ns()
        self._done(k, now)
        self._begun = now
        return True

    def figures(self) -> dict[str, Any]:
        """Return the figures of metrics.json, by name: times that the samples took [ms]."""
        return percentiles("step", self._taken[: self._count])

    def _done(self, k: int, now: int) -> None:
        if k:
            self._taken[k - 1] = (now - self._begun) * _MS
            self._count = k


class RealTimeClock(Clock):
    """Sample k is due at k h / factor after the first.

    Deadlines are absolute, so that lateness does not add up. Until shortly before one the process
    sleeps, then it spins. A sample that is not done when the next is due is an overrun: with
    `catch_up` the deadlines stay and those after it follow as fast as they can, with `slip` they
    move by what it was late, with `stop` the run ends.
    """

    def __init__(self, settings: RealTime, step_s: float, samples: int) -> None:
        super().__init__(samples)
        self._period = step_s * 1e9 / settings.factor
        self._spin = settings.spin_ms / _MS
        self._overrun: Overrun = settings.overrun
        self._late = np.zeros(samples)  # ms
        self._origin = 0
        self._overruns = 0
        self._due = 0  # samples that were due

    def __enter__(self) -> RealTimeClock:
        gc.collect()
        gc.freeze()
        gc.disable()  # a collection takes milliseconds
        return self

    def __exit__(self, *_: object) -> None:
        gc.enable()
        gc.unfreeze()

    def wait(self, k: int) -> bool:
        """Return when sample k is due, or at once if that is past; False to stop."""
        now = time.monotonic_ns()
        self._done(k, now)
        if k == 0:
            self._origin = now
        deadline = self._origin + round(k * self._period)
        if now > deadline:
            self._overruns += 1
            if self._overrun == "stop":
                late = (now - deadline) * _MS
                self.stopped = f"stopped at an overrun: sample {k} was {late:.3g} ms late"
                return False
            if self._overrun == "slip":
                self._origin += now - deadline
        else:
            now = self._until(deadline, now)
        self._late[k] = max(now - deadline, 0) * _MS
        self._begun, self._due = now, k + 1
        return True

    def _until(self, deadline: int, now: int) -> int:
        """Sleep, then spin, until the deadline; return the time."""
        asleep = deadline - now - self._spin
        if asleep > 0:
            time.sleep(asleep * 1e-9)
        while (now := time.monotonic_ns()) < deadline:
            pass
        return now

    def figures(self) -> dict[str, Any]:
        """Return the figures of metrics.json: lateness of the samples [ms] and overruns too."""
        late = self._late[: self._due]
        return {
            **super().figures(),
            **percentiles("lateness", late),
            "overruns": self._overruns,
            "histogram": histogram(late),
        }


def clock_of(settings: RealTime | None, step_s: float, samples: int) -> Clock:
    """Return the clock of a run of at most so many samples, `step_s` [s] apart."""
    return Clock(samples) if settings is None else RealTimeClock(settings, step_s, samples)
