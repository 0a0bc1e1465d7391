"""Runs by the clock: deadlines, overruns, figures of lateness (cosim.realtime)."""

from __future__ import annotations

import gc
import json
import re
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from hypothesis import given
from hypothesis import strategies as st
from loop_rig import write_scenario

from cosim.cli import main
from cosim.realtime.clock import Clock, RealTimeClock, clock_of
from cosim.realtime.lateness import EDGES_MS, histogram, percentiles
from cosim.scenario.real_time import RealTime


def cosim(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["run", *arguments])


class Watch:
    """In place of the module `time`: it goes on by what is slept, and by a microsecond a look."""

    def __init__(self, oversleeps_ms: float = 0.0) -> None:
        self.now, self.slept = 5_000_000_000, 0.0
        self._oversleeps = round(oversleeps_ms * 1e6)

    def monotonic_ns(self) -> int:
        self.now += 1000
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept += seconds
        self.now += round(seconds * 1e9) + self._oversleeps

    def work(self, ms: float) -> None:
        self.now += round(ms * 1e6)


def clocked(
    monkeypatch: pytest.MonkeyPatch, watch: Watch, samples: int = 10, **settings: Any
) -> RealTimeClock:
    monkeypatch.setattr("cosim.realtime.clock.time", watch)
    return RealTimeClock(RealTime(**settings), 0.01, samples)


# ---------------------------------------------------------------- deadlines


@pytest.mark.parametrize("factor", [1.0, 4.0, 0.5])
def test_deadlines_are_absolute(monkeypatch: pytest.MonkeyPatch, factor: float) -> None:
    """Each sample begins at its own multiple of the period, whatever those before it took."""
    watch = Watch()
    clock = clocked(monkeypatch, watch, factor=factor)
    began = []
    for k in range(10):
        assert clock.wait(k)
        began.append(watch.now)
        watch.work((0.1 + 0.1 * (k % 3)) / factor)
    expected = [began[0] + k * 10e6 / factor for k in range(10)]
    assert np.allclose(began, expected, rtol=0, atol=2000)
    figures = clock.figures()
    assert figures["overruns"] == 0
    assert figures["lateness_max_ms"] <= 0.002
    assert figures["step_max_ms"] == pytest.approx(0.3 / factor, abs=0.002)
    assert figures["histogram"]["samples"][0] == 10


def test_it_sleeps_first_and_then_spins(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sleep that takes a little too long is made up for by the spinning before the deadline."""
    for spin, latest in ((0.5, 0.002), (0.1, 0.3)):
        watch = Watch(oversleeps_ms=0.3)
        clock = clocked(monkeypatch, watch, spin_ms=spin)
        for k in range(10):
            clock.wait(k)
        assert watch.slept == pytest.approx(9 * (10 - spin) / 1000, abs=0.002)
        assert clock.figures()["lateness_max_ms"] <= latest


def lateness(clock: RealTimeClock, watch: Watch) -> list[float]:
    """Ten samples of 1 ms, of which the fourth takes 25 ms; how late each began, to 0.1 ms."""
    for k in range(10):
        if not clock.wait(k):
            break
        watch.work(25.0 if k == 3 else 1.0)
    return [round(float(late), 1) for late in clock._late]


def test_after_an_overrun_the_deadlines_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    watch = Watch()
    clock = clocked(monkeypatch, watch)
    assert lateness(clock, watch) == [0, 0, 0, 0, 15, 6, 0, 0, 0, 0]
    assert clock.figures()["overruns"] == 2
    assert clock.figures()["lateness_max_ms"] == pytest.approx(15.0, abs=0.01)
    assert not clock.stopped


def test_or_they_slip(monkeypatch: pytest.MonkeyPatch) -> None:
    watch = Watch()
    clock = clocked(monkeypatch, watch, overrun="slip")
    begin = watch.now
    assert lateness(clock, watch) == [0, 0, 0, 0, 15, 0, 0, 0, 0, 0]
    assert clock.figures()["overruns"] == 1
    assert watch.now - begin == pytest.approx((9 * 10 + 15 + 1) * 1e6, abs=10_000)


def test_or_the_run_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    watch = Watch()
    clock = clocked(monkeypatch, watch, overrun="stop")
    lateness(clock, watch)
    assert clock.stopped == "stopped at an overrun: sample 4 was 15 ms late"
    figures = clock.figures()
    assert figures["overruns"] == 1
    assert sum(figures["histogram"]["samples"]) == 4


def test_no_collection_of_garbage_inside() -> None:
    clock = clock_of(RealTime(), 0.01, 2)
    assert gc.isenabled()
    with clock:
        assert not gc.isenabled()
    assert gc.isenabled()


def test_without_the_clock_nothing_is_waited_for() -> None:
    clock = clock_of(None, 10.0, 4)
    begin = time.monotonic()
    with clock:
        for k in range(4):
            assert clock.wait(k)
            time.sleep(0.002)
    assert time.monotonic() - begin < 5.0
    figures = clock.figures()
    assert set(figures) == {"step_p50_ms", "step_p99_ms", "step_max_ms"}
    assert figures["step_p50_ms"] >= 2.0
    assert clock_of(None, 10.0, 4).figures() == {}
    assert isinstance(clock, Clock)


# ---------------------------------------------------------------- figures


@given(st.lists(st.floats(0, 1000), min_size=1, max_size=300))
def test_percentiles_are_times_that_occurred(times: list[float]) -> None:
    figures = percentiles("x", np.array(times))
    ordered = sorted(times)
    for name, share in (("x_p50_ms", 0.5), ("x_p99_ms", 0.99)):
        value = figures[name]
        assert value in times
        assert sum(t <= value for t in times) >= share * len(times) - 1e-9
        assert sum(t < value for t in times) < share * len(times)
    assert figures["x_max_ms"] == ordered[-1]


@given(st.lists(st.one_of(st.floats(0, 1000), st.sampled_from(EDGES_MS)), max_size=100))
def test_the_histogram_counts_each_once(times: list[float]) -> None:
    found = histogram(np.array(times))
    counted = Counter(next((i for i, edge in enumerate(EDGES_MS) if t <= edge), 13) for t in times)
    assert found["samples"] == [counted[i] for i in range(len(EDGES_MS) + 1)]


# ---------------------------------------------------------------- whole runs


def test_a_run_takes_the_time_that_it_should(tmp_path: Path) -> None:
    """Once as a field of the scenario, once as an option, which is laid over it. On a busy machine
    it may take longer.
    """
    path = write_scenario(tmp_path, sections={"real_time": "{factor: 2}"})
    for options, seconds in ((), 0.5), (("--real-time=4",), 0.25), (("--real-time",), 1.0):
        result = cosim(*options, str(path), "--output-dir", str(tmp_path / "out"), "--json")
        assert result.exit_code == 0, result.stderr
        run = json.loads(result.stdout)["runs"]["passive"]
        assert run["wall_time_s"] >= seconds
        timing = run["timing"]
        assert sum(timing["histogram"]["samples"]) == 101
        assert timing["lateness_p50_ms"] <= timing["lateness_p99_ms"] <= timing["lateness_max_ms"]
        assert timing["step_p50_ms"] > 0
    resolved = (tmp_path / "out" / "scenario.resolved.yaml").read_text()
    assert "factor: 1" in resolved


def test_the_results_are_the_same_by_the_clock_and_without(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, duration="0.3")
    for name, options in (("free", ()), ("clocked", ("--real-time=3",))):
        assert cosim(str(path), *options, "--output-dir", str(tmp_path / name)).exit_code == 0
    files = [(tmp_path / name / "signals.csv").read_bytes() for name in ("free", "clocked")]
    assert files[0] == files[1]


def test_an_overrun_that_stops_is_a_failed_run(tmp_path: Path) -> None:
    """At a thousand times real time no sample is done in 10 microseconds."""
    sections = {"real_time": "{factor: 1000, overrun: stop}"}
    path = write_scenario(tmp_path, sections=sections)
    result = cosim(str(path), "--output-dir", str(tmp_path / "out"))
    assert result.exit_code == 1
    assert "stopped at an overrun: sample 1 was" in result.stderr
    assert "1 of 1 limits FAILED" in result.stderr
    assert len((tmp_path / "out" / "signals.csv").read_text().splitlines()) == 2


def test_limits_on_lateness_count_in_real_time_only(tmp_path: Path) -> None:
    limits = "[{metric: timing.lateness_p99_ms, max: 0}, {metric: timing.step_p99_ms, min: 0}]"
    path = write_scenario(tmp_path, duration="0.2", sections={"limits": limits})
    free = cosim(str(path), "--output-dir", str(tmp_path / "out"))
    assert free.exit_code == 0, free.stderr
    assert "note: 1 limit is for runs in real time and left out" in free.stderr
    assert "lateness median" not in free.stderr
    assert "all 1 limits hold" in free.stderr
    clocked = cosim(str(path), "--real-time=2", "--output-dir", str(tmp_path / "out"))
    assert clocked.exit_code == 1
    assert "1 of 2 limits FAILED" in clocked.stderr
    said = r"passive: lateness median \d+\.\d{3} ms, 99 % [\d.]+ ms, at most [\d.]+ ms; \d+ overrun"
    assert re.match(said, clocked.stderr.splitlines()[1])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--real-time=fast"], "--real-time=fast: real_time.factor must be a number, not 'fast'"),
        (["--real-time=0"], "real_time.factor must be greater than 0, not 0"),
        (["--set", "real_time.overrun=slop"], "catch_up, slip or stop, not 'slop'; did you mean"),
        (["--set", "real_time.spin=1"], "'spin' is not a field of real_time; did you mean 'spin_"),
    ],
)
def test_wrong_settings(tmp_path: Path, options: list[str], words: str) -> None:
    result = cosim(str(write_scenario(tmp_path)), *options)
    assert result.exit_code == 2
    assert words in result.stderr
