"""The sensor on a CAN bus: docs/can.md.

`make can`, or `python docs/measure/can_bus.py`, writes the table of the frames from the DBC, drives
`scenarios/bus` and roads of three kinds, and measures what the bus's numbers cost. A few minutes;
the latencies want a machine that does nothing else.
"""

from __future__ import annotations

import os
import platform
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from markdown_tables import fill, percent, table

from cosim.assembly import assemble
from cosim.bus.codec import FrameSet, from_sensor, to_sensor
from cosim.bus.frame_table import bus_load_percent, frame_table
from cosim.dataset import NoSensor
from cosim.recorder import held
from cosim.run import execute
from cosim.scenario.load import load
from sensor import SensorError, evaluate
from sensor.channels import CHANNEL_NAMES
from sensor.conditions import CONDITIONS, Condition
from sensor.estimators import make

Array = npt.NDArray[np.float64]

ROOT = Path(__file__).parents[2]
SCENARIOS = ROOT / "scenarios"
ROADS = {
    "class C at 50 km/h": "road/class_c_50.yaml",
    "class B at 80 km/h": "road/class_b_80.yaml",
    "cobbles at 30 km/h": "road/cobbles_30.yaml",
    "Hockenheim on class A": "paper/hockenheim_normal.yaml",
}
ESTIMATORS = ("carried", "bilstm_w19", "bilstm_residual_w19", "kalman", "fir_residual_w64")
DURATION_S = 30.0
TIMES = [(what, part) for what in ("latency", "age") for part in ("p50", "p99", "max")]
LEFT_OUT = 200  # samples at the beginning
SPEEDS = [i for i, name in enumerate(CHANNEL_NAMES) if name.startswith("Car.v")]
COARSER = {
    "as the DBC says": {},
    "wheel speeds in 1/128 km/h": dict.fromkeys(SPEEDS, 16.0),
    "wheel speeds in 1/32 km/h": dict.fromkeys(SPEEDS, 64.0),
    "accelerations in 0.01 m/s²": dict.fromkeys((0, 1, 2), 0.01 / 0.000981),
    "rotation rates in 0.05 deg/s": dict.fromkeys((3, 4, 5), 10.0),
}
"""Changes of the DBC: factors on the steps of channels."""


@dataclass(frozen=True)
class Drive:
    """Channels (samples, 14) as measured, commands held (samples, 4) and truth (samples, 4)."""

    channels: Array
    commands: Array
    truth: Array


def drives(condition: Condition) -> list[Drive]:
    """Drive the roads with skyhook on the truth; no estimator is asked."""
    found = []
    for file in ROADS.values():
        overrides = [
            f"duration={DURATION_S}",
            "limits=[]",
            "controllers=[{kind: skyhook, feedback: truth}]",
            f"sensor.condition={condition}",
        ]
        scenario = load(SCENARIOS / file, overrides)
        assembly = assemble(scenario, scenario.controllers[0], NoSensor())
        assembly.run(None)
        record = assembly.recorder
        commands = held(record.group("command"), assembly.initial_command)
        found.append(Drive(record.group("channels").copy(), commands, record.group("truth").copy()))
    return found


def coarser(factors: Mapping[int, float]) -> FrameSet:
    """Return the frames to the sensor with other steps."""
    frames = to_sensor()
    for channel, factor in factors.items():
        frames.step[channel] *= factor
    return frames


def accuracy(name: str, condition: Condition, runs: list[Drive], frames: FrameSet | None) -> float:
    """Return the accuracy over all roads as one run [%], behind a bus or without one."""
    estimator, back = make(name, condition), from_sensor().step[:4]
    estimates = []
    for run in runs:
        both = np.hstack([run.channels, run.commands])
        given = both if frames is None else frames.quantised(both)
        estimate = estimator.apply(given[:, :14], given[:, 14:])
        estimates.append(estimate if frames is None else np.rint(estimate / back) * back)
    estimate, truth = np.vstack(estimates), np.vstack([run.truth for run in runs])
    counted = np.concatenate([np.arange(len(run.truth)) >= LEFT_OUT for run in runs])
    counted &= np.isfinite(estimate).all(axis=1)
    return float(evaluate(estimate, truth, counted).overall.accuracy)


def costs() -> str:
    """Return the table of accuracies without and with the bus."""
    recorded = {condition: drives(condition) for condition in CONDITIONS}
    header = ["estimator", "condition", "without bus", *COARSER]
    rows = []
    for name in ESTIMATORS:
        for condition, runs in recorded.items():
            try:
                alone = accuracy(name, condition, runs, None)
            except SensorError:
                continue
            behind = [accuracy(name, condition, runs, coarser(f)) for f in COARSER.values()]
            losses = [f"{value - alone:+.2f}" for value in behind]
            rows.append([f"`{name}`", condition, percent(alone), *losses])
    return table(header, rows)


def runs_of(overrides: list[str]) -> Mapping[str, Any]:
    """Run the bus's scenario; return the figures of its runs."""
    scenario = load(SCENARIOS / "bus" / "bus_class_c_50.yaml", overrides)
    with tempfile.TemporaryDirectory() as folder:
        runs: Mapping[str, Any] = execute(scenario, Path(folder)).metrics["runs"]
    return runs


def ride(runs: Mapping[str, Any]) -> str:
    """Return the table of the closed loop, direct and over the bus."""
    header = ["sensor", "accuracy, %", "a_w, m/s²", "deflection, mm", "tyre load, N"]
    rows = [
        [
            label.replace("_", " "),
            f"{run['sensor']['overall']['accuracy_percent']:.2f}",
            f"{run['comfort']['weighted_acceleration_m_s2']:.4f}",
            f"{1e3 * run['comfort']['deflection_rms_m']:.2f}",
            f"{run['comfort']['tyre_load_rms_n']:.1f}",
        ]
        for label, run in runs.items()
    ]
    return table(header, rows)


def latencies(ways: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the table of latencies and losses of runs over the bus."""
    header = ["", "samples", "late", "unanswered", "frames lost"]
    header += [f"{what} {part}, ms" for what, part in TIMES]
    rows = []
    for name, run in ways.items():
        counts = ("samples", "late_answers", "unanswered_samples", "frames_lost")
        found = [str(run["bus"].get(count, "not told")) for count in counts]
        found += [f"{run['bus'][f'{what}_{part}_ms']:.2f}" for what, part in TIMES]
        rows.append([name, *found])
    return table(header, rows)


def main() -> None:
    """Measure, and write the page."""
    lock_step = runs_of([])
    alone = ["controllers=[{kind: skyhook, name: over_bus}]", "limits=[]", "real_time.factor=1"]
    ways = {
        "lock-step, `deadline_ms: 1000`": lock_step["over_bus"],
        "real time, `deadline_ms: 5`": runs_of([*alone, "sensor.bus.deadline_ms=5"])["over_bus"],
        "real time, `deadline_ms: 0`, `oldest_samples: 2`": runs_of(
            [*alone, "sensor.bus.deadline_ms=0", "sensor.bus.oldest_samples=2"]
        )["over_bus"],
    }
    python = platform.python_version()
    values = {
        "frames": frame_table(),
        "load": f"{bus_load_percent():.0f}",
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, Python {python}",
        "roads": ", ".join(ROADS),
        "seconds": f"{DURATION_S:.0f}",
        "costs": costs(),
        "ride": ride(lock_step),
        "latencies": latencies(ways),
    }
    fill(ROOT / "docs" / "can.md", values)


if __name__ == "__main__":
    main()
