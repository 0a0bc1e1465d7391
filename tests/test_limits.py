"""Limits on signals: windows, statistics, verdicts, and what is said of wrong ones."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loop_rig import write_scenario

from cosim.errors import InputError
from cosim.limits import evaluate, window
from cosim.recorder import Recorder, Signal
from cosim.run import execute
from cosim.scenario.limit import Limit
from cosim.scenario.load import load
from cosim.signal_statistics import statistic, worst
from cosim.verdict import Verdict

finite = st.floats(-1e6, 1e6)


def recorded(values: list[float]) -> Recorder:
    """A record of one signal, `Car.ay`."""
    recorder = Recorder([("channels", [Signal("Car.ay", "m/s2")])], len(values))
    for k, value in enumerate(values):
        recorder.append(k, value)
    return recorder


def judged(values: list[float], **limit: Any) -> Verdict:
    runs: dict[str, dict[str, Any]] = {"passive": {}}
    wanted = Limit(signal="Car.ay", **limit)
    (verdict,) = evaluate([wanted], runs, {"passive": recorded(values)})
    return verdict


# ---------------------------------------------------------------- values


@given(st.lists(finite, min_size=1, max_size=50))
def test_statistics(values: list[float]) -> None:
    x, n = np.array(values), len(values)
    mean = math.fsum(values) / n
    scale = max(1.0, max(map(abs, values)))
    assert statistic("mean", x)[0] == pytest.approx(mean, abs=1e-9 * scale)
    rms = math.sqrt(math.fsum(v * v for v in values) / n)
    assert statistic("rms", x)[0] == pytest.approx(rms, rel=1e-9)
    std = math.sqrt(math.fsum((v - mean) ** 2 for v in values) / n)
    assert statistic("std", x)[0] == pytest.approx(std, rel=1e-6, abs=1e-9 * scale)
    peak, at = statistic("peak", x)
    assert peak == max(map(abs, values)) == abs(values[at or 0])
    assert statistic("final", x) == (values[-1], n - 1)


@given(st.lists(finite, min_size=1, max_size=50), st.none() | finite, st.none() | finite)
def test_the_worst_sample(values: list[float], low: float | None, high: float | None) -> None:
    def beyond(value: float) -> float:
        over = value - high if high is not None else -math.inf
        return max(over, low - value if low is not None else -math.inf)

    assert beyond(values[worst(np.array(values), low, high)]) == max(map(beyond, values))


@pytest.mark.parametrize(
    ("begin", "end", "rows"),
    [(None, None, (0, 1000)), (0.3, 0.3, (30, 31)), (0.29, 0.31, (29, 32)),
     (9.985, None, (999, 1000)), (20, None, (1000, 1000)), (None, 0.0, (0, 1))],
)  # fmt: skip
def test_windows_include_their_ends(
    begin: float | None, end: float | None, rows: tuple[int, int]
) -> None:
    """Where a time is k h, 0.29 may be another double than 29 h."""
    found = window(np.array([k * 0.01 for k in range(1000)]), begin, end)
    assert (found.start, found.stop) == rows


# ---------------------------------------------------------------- verdicts


@pytest.mark.parametrize(
    ("limit", "passed", "words"),
    [
        ({"max": 3.0}, True, "Car.ay is 3 m/s2 at 0.02 s, required at most 3 m/s2"),
        ({"max": 2.5}, False, "Car.ay is 3 m/s2 at 0.02 s, required at most 2.5 m/s2"),
        ({"min": -4.5, "max": 2}, False, "Car.ay is 3 m/s2 at 0.02 s"),
        ({"min": -4.5, "max": 4}, False, "Car.ay is -5 m/s2 at 0.01 s"),
        ({"max": 2, "to_s": 0.01}, True, "Car.ay to 0.01 s is 1 m/s2 at 0 s"),
        ({"max": 2, "from_s": 0.03}, True, "Car.ay from 0.03 s is 2 m/s2 at 0.03 s"),
        ({"max": 4, "statistic": "peak"}, False, "peak of Car.ay is 5 m/s2 at 0.01 s"),
        ({"max": 0.3, "statistic": "mean"}, True, "mean of Car.ay is 0.25 m/s2, required"),
        ({"min": 3, "statistic": "rms", "from_s": 0.01, "to_s": 0.02}, True,
         "rms of Car.ay from 0.01 s to 0.02 s is 4.123 m/s2"),
        ({"max": 9, "from_s": 5}, False, "is not available (no sample in this window)"),
    ],
)  # fmt: skip
def test_verdicts(limit: dict[str, Any], passed: bool, words: str) -> None:
    verdict = judged([1.0, -5.0, 3.0, 2.0], **limit)
    assert verdict.passed is passed
    assert words in str(verdict)


@pytest.mark.parametrize("name", ["each", "mean", "peak", "final"])
def test_a_sample_that_is_no_number_fails(name: str) -> None:
    verdict = judged([math.nan, 1.0], max=5.0, statistic=name)
    assert not verdict.passed
    assert "not available (not a number at 0 s)" in str(verdict)
    assert judged([math.nan, 1.0], max=5.0, statistic=name, from_s=0.01).passed


def test_a_limit_may_be_for_one_run() -> None:
    runs: dict[str, dict[str, Any]] = {"soft": {}, "hard": {}}
    records = {"soft": recorded([1.0]), "hard": recorded([2.0])}
    limits = [Limit(signal="Car.ay", max=1.5), Limit(signal="hard.Car.ay", min=2)]
    found = [(v.run, v.passed) for v in evaluate(limits, runs, records)]
    assert found == [("soft", True), ("hard", False), ("hard", True)]


def test_in_a_scenario(tmp_path: Path) -> None:
    """On a smooth road at 50 km/h; the estimate comes late."""
    limits = (
        "[{signal: Car.vx, min: 13, max: 15}, {signal: time, statistic: final, min: 0.5, max: 0.5},"
        " {signal: VRel.Valid, min: 1}, {signal: Truth.VRel.FL, statistic: rms, max: 0.01}]"
    )
    path = write_scenario(tmp_path, duration="0.5", sections={"limits": limits})
    outcome = execute(load(path), tmp_path / "out")
    assert [v.passed for v in outcome.verdicts] == [True, True, False, True]
    written = json.loads((tmp_path / "out" / "metrics.json").read_text())["limits"]
    assert written[2]["metric"] == "VRel.Valid"
    assert (written[2]["value"], written[2]["at_s"], written[2]["passed"]) == (0.0, 0.0, False)
    assert "VRel.Valid" in (tmp_path / "out" / "report.html").read_text()


# ---------------------------------------------------------------- wrong ones


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ("{signal: Car.azz, max: 1}", "'Car.azz' is not a recorded signal; did you mean 'Car.az'"),
        ("{signal: passive.Car.azz, max: 1}", "'Car.azz' is not a recorded signal; did you mean"),
        ("{signal: soft.Car.az, max: 1}", "'soft.Car.az' is not a recorded signal"),
        ("{signal: Ideal.Car.az, max: 1}", "'Ideal.Car.az' is not recorded in run passive: it is"),
        ("{signal: Car.az}", "a limit needs min, max or both"),
        ("{max: 3}", "a limit needs either a metric or a signal"),
        ("{metric: lap_time_s, signal: Car.az, max: 3}", "needs either a metric or a signal"),
        ("{metric: lap_time_s, max: 3, to_s: 2}", "to_s belongs to a limit on a signal, not on a"),
        ("{signal: Car.az, max: 1, from_s: 3, to_s: 2}", "from_s (3.0 s) must not be after to_s"),
        ("{signal: Car.az, max: 1, from_s: -1}", "from_s must be at least 0 s, not -1 s"),
        ("{signal: Car.az, max: 1, statistic: rsm}", "or final, not 'rsm'; did you mean 'rms'?"),
    ],
)
def test_what_is_wrong_is_said_before_the_run(tmp_path: Path, limit: str, words: str) -> None:
    path = write_scenario(tmp_path, sections={"limits": f"[{limit}]"})
    with pytest.raises(InputError) as caught:
        load(path)
    assert len(caught.value.problems) == 1
    assert words in str(caught.value)
    assert "scenario.yaml:5:" in str(caught.value)


def test_a_wrong_signal_is_said_beside_other_mistakes(tmp_path: Path) -> None:
    sections = {"limits": "[{signal: Car.azz, max: 1}]", "seed": "-1", "goldens": "[{signal: x}]"}
    with pytest.raises(InputError) as caught:
        load(write_scenario(tmp_path, sections=sections))
    assert len(caught.value.problems) == 4
