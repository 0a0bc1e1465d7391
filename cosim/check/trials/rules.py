"""Trials of the rules: the token, the order of calls, values that are set, memory."""

from __future__ import annotations

import math
import os
import sys
import threading
from collections.abc import Callable
from typing import Any, Final

from cosim.check.trials.bench import Bench, first_difference
from cosim.check.trials.instance import Instance
from cosim.check.trials.job import Answer, Channel
from cosim.check.trials.library import WARNING, Refused
from cosim.check.trials.running import reference

WRONG_TOKEN: Final = "{00000000-0000-0000-0000-00000000beef}"
LIVES: Final = 200
_SETTLED: Final = 50  # lives before the memory is weighed for the first time
LEAK: Final = 1024  # bytes a life


def token(bench: Bench, answer: Answer) -> None:
    """A wrong token must be refused: it tells that XML and binary belong together."""
    try:
        instance = bench.instance(WRONG_TOKEN)
    except Refused:
        return
    instance.free()
    name = "GUID" if bench.job.major == 2 else "instantiation token"
    answer.add(
        "token-not-checked", bench.library.full_name("Instantiate"),
        f"it can be instantiated with the wrong {name} {WRONG_TOKEN}; XML and binary of "
        "different builds would not be noticed",
    )  # fmt: skip


def order(bench: Bench, answer: Answer) -> None:
    """Calls at the wrong time must answer Error."""

    def step(instance: Instance, when: str) -> int:
        return instance.try_step(bench.job.start, bench.job.step, when)

    def leave(instance: Instance, when: str) -> int:
        return instance.try_("ExitInitializationMode", note=when)

    def ended(instance: Instance) -> None:
        instance.initialise()
        instance.do("Terminate")

    cases: tuple[tuple[str, Callable[[Instance], None], Callable[[Instance, str], int], str], ...]
    cases = (
        ("DoStep", lambda i: None, step, "before initialisation"),
        ("ExitInitializationMode", lambda i: None, leave, "without EnterInitializationMode"),
        ("DoStep", ended, step, "after Terminate"),
    )
    for function, prepare, call, when in cases:
        instance = bench.instance()
        try:
            prepare(instance)
        except Refused:
            continue
        name = bench.library.full_name(function)
        if call(instance, f", called {when},") <= WARNING:
            answer.add(
                "wrong-order-accepted", name, f"{name} {when} answers OK; it must answer Error"
            )
        instance.free()


def values(bench: Bench, answer: Answer) -> None:
    """Set parameters and inputs to other values of their range and read them back."""
    instance = bench.instance()
    instance.enter()
    for channel in (*bench.parameters, *bench.inputs):
        _start(instance, channel, answer)
    for channel in (*bench.parameters, *bench.inputs):
        if channel.causality == "structuralParameter":
            continue
        other = other_value(channel)
        if other is None:
            continue
        wanted = [other] * channel.size
        try:
            instance.set(channel, wanted)
        except Refused as refusal:
            answer.add(
                "set-refused", channel.name,
                f"{channel.name} = {other!r}, within its range, is refused: {refusal}",
            )  # fmt: skip
            continue
        try:
            kept = instance.get(channel)
        except Refused:
            continue
        if kept != wanted and not _float32(channel, wanted, kept):
            answer.add(
                "value-not-kept", channel.name,
                f"{channel.name} was set to {other!r} and reads back {kept[0]!r}",
            )  # fmt: skip
    instance.free()


def _start(instance: Instance, channel: Channel, answer: Answer) -> None:
    """The binary's own start value must be that of the XML: masters set only what they change."""
    if channel.start is None or channel.size > 1:
        return
    try:
        value = instance.get(channel)[0]
    except Refused:
        return
    same = value == channel.start
    if channel.is_float:
        same = math.isclose(value, channel.start, rel_tol=1e-6, abs_tol=1e-300)
    if not same:
        answer.add(
            "start-differs", channel.name,
            f"{channel.name} starts at {value!r} in the binary, but at {channel.start!r} in the "
            "XML",
        )  # fmt: skip


def _float32(channel: Channel, wanted: list[Any], kept: list[Any]) -> bool:
    if channel.type != "Float32":
        return False
    return all(math.isclose(a, b, rel_tol=1e-6) for a, b in zip(wanted, kept, strict=True))


def other_value(channel: Channel) -> Any:
    """Return a value near the start and within the range, None if there is no other."""
    start = channel.start
    low = -math.inf if channel.low is None else channel.low
    high = math.inf if channel.high is None else channel.high
    if channel.type == "Boolean":
        return not start
    if channel.type == "String" or start is None:
        return None  # a text may be a file's name
    if channel.is_float:
        reach = max(1e-3 * abs(start), 1e-3 * abs(channel.nominal or 1.0), 1e-9)
        for step in (reach, -reach, (high - start) / 2, (low - start) / 2):
            if step and math.isfinite(step) and low <= start + step <= high:
                return float(start + step)
        return None
    return next((v for v in (start + 1, start - 1) if low <= v <= high), None)


def thread(bench: Bench, answer: Answer) -> None:
    """Instantiate on one thread, step on another."""
    expected = reference(bench)
    instance, watch = bench.ready()
    rows: list[Any] = []
    refusals: list[Refused] = []

    def elsewhere() -> None:
        try:
            rows.extend([watch.read(), *bench.rows(instance, watch, 0, len(expected) - 1)])
        except Refused as refusal:
            refusals.append(refusal)

    other = threading.Thread(target=elsewhere)
    other.start()
    other.join()
    parted = first_difference(bench, watch.names, expected, rows, -1)
    if refusals or parted:
        answer.add(
            "thread-bound", bench.library.full_name("DoStep"),
            "it does not run on another thread than the one that made it: "
            f"{refusals[0] if refusals else parted}",
        )  # fmt: skip
    instance.free()


def memory(bench: Bench, answer: Answer) -> None:
    """Many lives, one after the other; the memory must stay what it is."""
    weights: list[tuple[int, int]] = []
    for life in range(1, LIVES + 1):
        instance, _ = bench.ready()
        instance.step(bench.job.start, bench.job.step)
        instance.try_("Terminate")
        instance.free()
        if life in (_SETTLED, LIVES) or (life > _SETTLED and bench.out_of_time):
            weights.append((life, resident()))
        if bench.out_of_time:
            break
    if len(weights) < 2 or not weights[0][1]:
        return
    (first, before), (last, after) = weights
    each = (after - before) / (last - first)
    if each > LEAK and after - before > 128 * 1024:
        answer.add(
            "memory-growth", "FreeInstance",
            f"{(after - before) / 1024:.0f} KiB more after {last - first} lives of an instance, "
            f"{each / 1024:.1f} KiB each: something is not freed",
        )  # fmt: skip


def resident() -> int:
    """Return the memory of this process [bytes], 0 where the system does not tell."""
    if sys.platform.startswith("linux"):
        with open("/proc/self/statm", encoding="ascii") as file:  # noqa: PTH123
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    if sys.platform == "win32":
        return 0
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
