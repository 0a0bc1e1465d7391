"""Trials of states: replay, bytes, reset, and instances that must not touch each other."""

from __future__ import annotations

from cosim.check.trials.bench import Bench, Watch, difference, first_difference
from cosim.check.trials.instance import Instance
from cosim.check.trials.job import Answer
from cosim.check.trials.library import Refused
from cosim.check.trials.rules import other_value
from cosim.check.trials.running import reference

_STATE = ("GetFMUState", "SetFMUState", "FreeFMUState")
_BYTES = ("SerializedFMUStateSize", "SerializeFMUState", "DeserializeFMUState")


def state(bench: Bench, answer: Answer) -> None:
    """Get a state, go on, set it, go on again: the bits must be the same."""
    if "state" not in bench.job.flags or not bench.library.has(*_STATE):
        return
    total = len(reference(bench)) - 1
    half = max(total // 3, 1)
    set_name = bench.library.full_name("SetFMUState")
    instance, watch = bench.ready()
    try:
        bench.rows(instance, watch, 0, half)
        before, saved = watch.read(), instance.get_state()
        first = bench.rows(instance, watch, half, total)
    except Refused as refusal:
        answer.add("state-call-failed", refusal.function, f"during a saved state: {refusal}")
        return
    try:
        instance.set_state(saved)
        parted = difference(watch.names, before, watch.read())
        second = [] if parted else bench.rows(instance, watch, half, total)
    except Refused as refusal:
        answer.add(
            "state-not-restored", set_name,
            f"after {set_name} the steps from the saved time are refused: {refusal}",
        )  # fmt: skip
        return
    words = (
        f"{parted[0]} is {parted[2]!r} right after {set_name}, and was {parted[1]!r} when the "
        "state was got"
        if parted
        else first_difference(bench, watch.names, first, second, half)
    )
    if words:
        answer.add("state-not-restored", set_name, f"a replay from a saved state differs: {words}")
    instance.free_state(saved)
    instance.free()


def serialised(bench: Bench, answer: Answer) -> None:
    """Move a state through bytes into another instance: the bits must be the same."""
    if not {"state", "bytes"} <= set(bench.job.flags) or not bench.library.has(*_STATE, *_BYTES):
        return
    total = len(reference(bench)) - 1
    half = max(total // 3, 1)
    instance, watch = bench.ready()
    bench.rows(instance, watch, 0, half)
    name = bench.library.full_name("DeserializeFMUState")
    try:
        saved = instance.get_state()
        content = instance.serialise(saved)
        instance.free_state(saved)
        first = bench.rows(instance, watch, half, total)
        other, view = _second(bench) or (instance, watch)
        restored = other.deserialise(content)
        other.set_state(restored)
        second = bench.rows(other, view, half, total)
    except Refused as refusal:
        answer.add(
            "serialise-failed", refusal.function,
            f"a state does not survive as bytes: {refusal}",
        )  # fmt: skip
        return
    words = first_difference(bench, watch.names, first, second, half)
    if words:
        answer.add("serialised-state-differs", name, f"a state that went through bytes: {words}")
    other.free_state(restored)
    other.free()


def _second(bench: Bench) -> tuple[Instance, Watch] | None:
    """Return another instance if there can be one."""
    try:
        return None if "once" in bench.job.flags else bench.ready()
    except Refused:
        return None


def reset(bench: Bench, answer: Answer) -> None:
    """After reset an instance must run as a fresh one does."""
    expected = reference(bench)
    name = bench.library.full_name("Reset")
    instance = _used(bench)
    try:
        instance.do("Reset")
    except Refused as refusal:
        answer.add("reset-incomplete", name, f"{refusal}")
        return
    try:
        instance.initialise()
        watch = Watch(instance, bench.watched)
        found = [watch.read(), *bench.rows(instance, watch, 0, len(expected) - 1)]
    except Refused as refusal:
        answer.add(
            "reset-incomplete", name,
            f"after {name} the instance is not as it was after instantiation: {refusal}",
        )  # fmt: skip
        return
    words = first_difference(bench, watch.names, expected, found, -1)
    if words:
        answer.add(
            "reset-incomplete", name, f"after {name} a run differs from a fresh one: {words}"
        )
    instance.free()


def _used(bench: Bench) -> Instance:
    """Return an instance after some steps, its parameters changed a little if it lets us."""
    for changed in (True, False):
        instance = bench.instance()
        try:
            instance.enter()
            if changed:
                change_parameters(bench, instance)
            instance.do("ExitInitializationMode")
            watch = Watch(instance, bench.watched)
            bench.rows(instance, watch, 0, 5, phase=1)
        except Refused:
            continue
        return instance
    return bench.ready()[0]


def change_parameters(bench: Bench, instance: Instance) -> None:
    """Set every real parameter a little off its start; what is refused stays."""
    for channel in bench.parameters:
        value = other_value(channel) if channel.is_float else None
        if value is not None and channel.causality == "parameter":
            try:
                instance.set(channel, [value] * channel.size)
            except Refused:
                continue


def instances(bench: Bench, answer: Answer) -> None:
    """Two instances in turn, of other inputs and parameters: each must run as if alone."""
    if "once" in bench.job.flags:
        return
    expected = reference(bench)
    try:
        one, watch = bench.ready()
        two = bench.instance()
        two.enter()
        change_parameters(bench, two)
        two.do("ExitInitializationMode")
    except Refused as refusal:
        answer.add(
            "instances-share", refusal.function,
            "a second instance is refused, but canBeInstantiatedOnlyOncePerProcess is not true: "
            f"{refusal}",
        )  # fmt: skip
        return
    view = Watch(two, bench.watched)
    rows = [watch.read()]
    try:
        for k in range(len(expected) - 1):
            rows += bench.rows(one, watch, k, k + 1)
            bench.rows(two, view, k, k + 1, phase=1)
    except Refused as refusal:
        answer.add(
            "instances-share", refusal.function, f"with two instances in one process: {refusal}"
        )
        return
    words = first_difference(bench, watch.names, expected, rows, -1)
    if words:
        answer.add(
            "instances-share", "two instances",
            f"one instance changes the other, as with static variables: {words}",
        )  # fmt: skip
    one.free()
    two.free()
