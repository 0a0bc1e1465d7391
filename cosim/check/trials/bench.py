"""What every trial needs: the watched outputs, inputs that move, rows, and their comparison."""

from __future__ import annotations

import ctypes
import math
import struct
import time
from collections.abc import Sequence
from typing import Any, Final

from cosim.check.trials.instance import Instance
from cosim.check.trials.job import Answer, Channel, Job
from cosim.check.trials.library import Library
from cosim.isolation.journal import Journal

Row = list[Any]
ROWS: Final = 40  # steps of the run that others are compared with
_SETTABLE: Final = ("Clock", "Binary")


class Watch:
    """Reads chosen variables of an instance into one row, one call for each type."""

    def __init__(self, instance: Instance, channels: Sequence[Channel]) -> None:
        self._instance = instance
        groups: dict[str, list[Channel]] = {}
        for channel in channels:
            groups.setdefault(instance.library.values(channel)[0], []).append(channel)
        self.names: list[str] = []
        self.channels: list[Channel] = []
        self._calls = []
        for kind, group in groups.items():
            size = sum(channel.size for channel in group)
            _, one = instance.library.values(group[0])
            values = (one._type_ * size)()
            references = (ctypes.c_uint32 * len(group))(*(c.reference for c in group))
            arguments = [references, ctypes.c_size_t(len(group)), values]
            if instance.library.major == 3:
                arguments.append(ctypes.c_size_t(size))
            self._calls.append((f"Get{kind}", arguments, values))
            for channel in group:
                many = channel.size > 1
                self.names += [
                    f"{channel.name}[{i + 1}]" if many else channel.name
                    for i in range(channel.size)
                ]
                self.channels += [channel] * channel.size

    def read(self, when: str = "") -> Row:
        """Return the present values."""
        row: Row = []
        for function, arguments, values in self._calls:
            self._instance.do(function, *arguments, note=when)
            row += [v.decode("utf-8", "replace") if isinstance(v, bytes) else v for v in values]
        return row


class Bench:
    """A library under trial and the experiment it is tried in."""

    def __init__(self, job: Job, journal: Journal) -> None:
        self.job = job
        self.library = Library(job, journal)
        usable = [c for c in job.channels if c.type not in _SETTABLE]
        self.inputs = [c for c in usable if c.causality == "input"]
        outputs = [c for c in usable if c.causality == "output"]
        self.watched = outputs or [c for c in usable if c.causality == "local"]
        self.parameters = [c for c in usable if c.causality in ("parameter", "structuralParameter")]
        self.time = next((c for c in usable if c.causality == "independent"), None)
        self._end = time.perf_counter() + job.budget

    def instance(self, token: str | None = None) -> Instance:
        """Return a new instance. Raises `Refused`."""
        return Instance(self.library, token)

    def ready(self) -> tuple[Instance, Watch]:
        """Return a new instance after initialisation, and a watch on its outputs."""
        instance = self.instance()
        instance.initialise()
        return instance, Watch(instance, self.watched)

    @property
    def out_of_time(self) -> bool:
        """Whether the wall time for repeated steps is used up."""
        return time.perf_counter() > self._end

    def at(self, k: int) -> float:
        """Return the time [s] of step k."""
        return self.job.start + k * self.job.step

    def steps(self) -> int:
        """Return the number of default steps in the default experiment."""
        return max(1, round((self.job.stop - self.job.start) / self.job.step))

    def move(self, instance: Instance, k: int, phase: int = 0) -> None:
        """Set the real inputs for step k: each swings about its start within its range."""
        if not self.job.moving:
            return
        for i, channel in enumerate(self.inputs):
            if channel.is_float:
                value = swing(channel, 0.37 * k + 0.5 + 1.3 * i + 2.0 * phase)
                instance.set(channel, [value] * channel.size)

    def rows(
        self, instance: Instance, watch: Watch, first: int, last: int, phase: int = 0
    ) -> list[Row]:
        """Step from `first` to `last` with moving inputs; return the row after each step."""
        made = []
        for k in range(first, last):
            self.move(instance, k, phase)
            instance.step(self.at(k), self.job.step)
            made.append(watch.read())
        return made


def swing(channel: Channel, angle: float) -> float:
    """Return a value that moves about the start value with a tenth of the range [own unit]."""
    start = float(channel.start or 0.0)
    low = -math.inf if channel.low is None else channel.low
    high = math.inf if channel.high is None else channel.high
    if math.isfinite(low) and math.isfinite(high):
        reach = 0.1 * (high - low)
    else:
        reach = 0.1 * max(abs(start), abs(channel.nominal or 1.0))
    centre = min(max(start, low + reach), high - reach)
    return min(max(centre + reach * math.sin(angle), low), high)


def difference(names: Sequence[str], a: Row, b: Row) -> tuple[str, Any, Any] | None:
    """Return the first variable whose bits differ between two rows, with both values."""
    for name, x, y in zip(names, a, b, strict=True):
        if _bits(x) != _bits(y):
            return name, x, y
    return None


def first_difference(
    bench: Bench, names: Sequence[str], expected: list[Row], found: list[Row], first: int = 0
) -> str:
    """Return in words where two runs part, '' if they do not."""
    for k, (a, b) in enumerate(zip(expected, found, strict=False), start=first):
        parted = difference(names, a, b)
        if parted:
            name, x, y = parted
            return f"{name} is {y!r} instead of {x!r} at t = {bench.at(k + 1):.6g} s"
    return ""


def finite_check(answer: Answer, watch: Watch, row: Row, t: float, seen: set[str]) -> None:
    """Report each output that is NaN or infinite, the first time it is."""
    for name, channel, value in zip(watch.names, watch.channels, row, strict=True):
        if channel.is_float and not math.isfinite(value) and name not in seen:
            seen.add(name)
            answer.add(
                "output-not-finite", name, f"{name} is {value} at t = {t:.6g} s; outputs are finite"
            )


def _bits(value: Any) -> Any:
    return struct.pack("<d", value) if isinstance(value, float) else value
