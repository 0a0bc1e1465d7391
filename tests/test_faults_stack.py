"""Any stack of faults: where it acts, in which order, what it may make of a sample."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
from fault_rig import block, through, varied
from hypothesis import given
from hypothesis import settings as how
from hypothesis import strategies as st
from loop_rig import Guess

from cosim.faults.latency import LateDampers, LateSensor
from cosim.faults.stack import FaultStack, NoFaults
from cosim.scenario.fault_channels import GROUPS, indices
from sensor.channels import CHANNEL_NAMES, CHANNEL_UNITS

SAMPLES = 150
sizes = st.floats(0.001, 100.0)
signed = st.floats(-100.0, 100.0)
names = st.one_of(st.sampled_from([*CHANNEL_NAMES, *GROUPS]), st.just("imu"))
one_unit = names.filter(lambda name: len({CHANNEL_UNITS[i] for i in indices([name])}) == 1)


@st.composite
def windows(draw: st.DrawFn, ramped: bool) -> dict[str, float]:
    start = draw(st.integers(0, 100))
    length = draw(st.integers(2, 60))
    window = {"start_s": start / 100, "end_s": (start + length) / 100}
    if ramped and draw(st.booleans()):
        window["ramp_s"] = math.floor(length / 2) / 100
    return window


def of_kind(kind: str, channels: Any, ramped: bool = True, **fields: Any) -> Any:
    made = st.fixed_dictionaries({"kind": st.just(kind), "channels": channels, **fields})
    return st.tuples(made, windows(ramped)).map(lambda pair: {**pair[0], **pair[1]})


seeds = st.integers(0, 5)
FILLING = of_kind("dropout", names, fill=st.just("nan"), share=st.floats(0.1, 1.0), seed=seeds)
FINITE = st.one_of(
    of_kind("noise", one_unit, rms=sizes, seed=seeds),
    of_kind("bias", one_unit, value=signed),
    of_kind("drift", one_unit, rate=signed),
    of_kind("gain", names, factor=signed),
    of_kind("quantisation", one_unit, step=sizes),
    of_kind("saturation", one_unit, False, min=st.floats(-9, 0), max=st.floats(0.5, 9)),
    of_kind("delay", names, delay_ms=st.floats(0.1, 90.0)),
    of_kind("jitter", names, max_ms=st.floats(0.1, 90.0), seed=seeds),
    of_kind("dropout", names, fill=st.just("hold"), share=st.floats(0.1, 1.0), seed=seeds),
    of_kind("dropout", names, fill=st.just("hold"), share=st.just(0.5),
            outage_s=st.floats(0.01, 0.3), seed=seeds),
    of_kind("stuck", one_unit, False, value=st.one_of(st.none(), signed)),
    of_kind("spikes", one_unit, height=sizes, rate_hz=st.floats(1.0, 100.0), seed=seeds),
    st.tuples(
        st.permutations(["FL", "FR", "RL", "RR"]), windows(False)
    ).map(lambda p: {"kind": "swapped_wheels", "wheels": p[0][:2], **p[1]}),
)  # fmt: skip
ANY = st.one_of(FINITE, FILLING)


def acts_on(fault: dict[str, Any]) -> list[int]:
    if fault["kind"] == "swapped_wheels":
        return [CHANNEL_NAMES.index(f"Car.v{wheel}") for wheel in fault["wheels"]]
    return list(indices([fault["channels"]]))


def inside(fault: dict[str, Any]) -> Any:
    """The samples and channels that a fault may touch, (samples, 14)."""
    touched = np.zeros((SAMPLES, 14), dtype=bool)
    rows = slice(round(fault["start_s"] * 100), round(fault["end_s"] * 100))
    touched[rows, acts_on(fault)] = True
    return touched


@given(st.lists(ANY, min_size=1, max_size=4), st.integers(0, 3))
@how(max_examples=60, deadline=None)
def test_outside_its_window_and_its_channels_a_fault_changes_nothing(
    faults: list[dict[str, Any]], seed: int
) -> None:
    channels = varied(SAMPLES, seed)
    found = through(channels, *faults, seed=seed)
    outside = ~np.any([inside(fault) for fault in faults], axis=0)
    assert found[outside].tobytes() == channels[outside].tobytes()


@given(st.lists(ANY, min_size=2, max_size=4))
@how(max_examples=40, deadline=None)
def test_each_fault_acts_on_what_the_one_before_left(faults: list[dict[str, Any]]) -> None:
    pinned = [{"seed": 3, **fault} if "seed" in fault else fault for fault in faults]
    step_by_step = varied(SAMPLES)
    for fault in pinned:
        step_by_step = through(step_by_step, fault)
    assert through(varied(SAMPLES), *pinned).tobytes() == step_by_step.tobytes()


@given(st.lists(ANY, min_size=1, max_size=4))
@how(max_examples=60, deadline=None)
def test_nan_stands_only_where_it_was_asked_for(faults: list[dict[str, Any]]) -> None:
    """A gap may be carried on, later in time, by a fault that comes after it."""
    found = np.isnan(through(varied(SAMPLES), *faults))
    asked = np.zeros((SAMPLES, 14), dtype=bool)
    for fault in faults:
        if fault.get("fill") == "nan":
            asked |= inside(fault)
        elif fault["kind"] in ("delay", "jitter", "dropout", "stuck", "swapped_wheels"):
            reached = asked.any(axis=0)
            if fault["kind"] == "swapped_wheels" and reached[acts_on(fault)].any():
                reached[acts_on(fault)] = True
            first = np.maximum.accumulate(asked, axis=0).any(axis=1)
            asked |= reached & first[:, np.newaxis] & inside(fault)
    assert not (found & ~asked).any()
    if not any(fault.get("fill") == "nan" for fault in faults):
        assert not found.any()


@given(st.lists(ANY, min_size=1, max_size=3), seeds)
@how(max_examples=20, deadline=None)
def test_the_same_seed_gives_the_same_bytes(faults: list[dict[str, Any]], seed: int) -> None:
    one, again = (through(varied(SAMPLES), *faults, seed=seed) for _ in range(2))
    assert one.tobytes() == again.tobytes()


@given(st.lists(st.one_of(FINITE, FILLING), min_size=1, max_size=4))
@how(max_examples=40, deadline=None)
def test_gaps_are_bridged_by_the_last_value_that_came(faults: list[dict[str, Any]]) -> None:
    stack = block(*faults)
    last = np.zeros(14)
    for k, sample in enumerate(varied(SAMPLES)):
        given_to_sensor = stack.step(k, sample)
        last = np.where(np.isnan(given_to_sensor), last, given_to_sensor)
        np.testing.assert_array_equal(stack.bridged, last)


def test_the_order_of_faults_counts() -> None:
    gain = {"kind": "gain", "channels": "all", "factor": 2.0}
    bias = {"kind": "bias", "channels": "Car.az", "value": 1.0}
    assert through(np.zeros((1, 14)), bias, gain)[0, 2] == 2.0
    assert through(np.zeros((1, 14)), gain, bias)[0, 2] == 1.0


def test_seeds_tell_faults_apart() -> None:
    noise = {"kind": "noise", "channels": "Car.az", "rms": 1.0}
    calm = np.zeros((50, 14))
    first, second = through(calm, noise)[:, 2], through(calm, noise, noise)[:, 2]
    assert not np.array_equal(second, 2 * first)  # two of the same kind are not the same noise
    np.testing.assert_allclose(through(calm, {**noise, "seed": 4}, {**noise, "seed": 4})[:, 2],
                               2 * through(calm, {**noise, "seed": 4})[:, 2])  # fmt: skip
    assert not np.array_equal(through(calm, noise, seed=2)[:, 2], first)
    assert not np.array_equal(
        through(calm, {**noise, "seed": 0})[:, 2], first
    )  # 0 of its own is not its place 0


def test_without_faults_the_channels_are_passed_on_as_they_are() -> None:
    none = block()
    channels = varied(1)[0]
    assert isinstance(none, NoFaults)
    assert none.step(0, channels) is channels
    assert none.bridged is channels


def grown(step: Callable[[int], object]) -> tuple[int, int]:
    """Return by how many bytes 300 steps let the memory grow, at their end and at most."""
    for k in range(300):
        step(k)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for k in range(300, 600):
        step(k)
    now, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return now - before, peak - before


def test_latencies_allocate_nothing() -> None:
    command, sample = np.zeros(4), np.zeros(14)
    dampers, sensor = LateDampers(3, command), LateSensor(Guess(), 3)
    for step in (lambda _: dampers.step(command), lambda _: sensor.step(sample, command)):
        end, most = grown(step)
        assert end < 512
        assert most < 2048


def test_a_step_allocates_nothing() -> None:
    stack = block(
        {"kind": "noise", "channels": "imu", "rms": 0.1} | {"channels": "accelerations"},
        {"kind": "drift", "channels": "Car.az", "rate": 0.1},
        {"kind": "quantisation", "channels": "Car.az", "step": 0.1},
        {"kind": "saturation", "channels": "Car.az", "min": -0.1, "max": 0.1},
        {"kind": "spikes", "channels": "Car.az", "height": 0.1, "rate_hz": 50},
        {"kind": "gain", "channels": "imu", "factor": 1.1},
        {"kind": "stuck", "channels": "Car.ax"},
        {"kind": "delay", "channels": "wheel_speeds", "delay_ms": 12},
        {"kind": "jitter", "channels": "all", "max_ms": 12},
        {"kind": "dropout", "channels": "steering", "fill": "nan", "share": 0.5},
        {"kind": "dropout", "channels": "imu", "fill": "hold", "share": 0.5, "outage_s": 0.1},
        {"kind": "swapped_wheels", "wheels": ["FL", "RR"]},
    )
    assert isinstance(stack, FaultStack)
    channels = varied(600)
    end, most = grown(lambda k: stack.step(k, channels[k]))
    assert end < 512
    assert most < 2048
