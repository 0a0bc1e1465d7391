"""A run without FMU and network: a bouncing car of known motion, an estimator of known error."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import FmuError
from cosim.recorder import Recorder, Signal
from cosim.scenario.schema import Scenario
from sensor import CHANNELS, OUTPUTS

WINDOW = 19
GROUPS = (
    ("channels", [Signal(c.name, c.unit, c.description) for c in CHANNELS]),
    ("estimate", [Signal(c.name, c.unit, c.description) for c in OUTPUTS]),
    ("valid", [Signal("Sensor.Valid", "")]),
    ("truth", [Signal(f"Truth.{c.name}", c.unit) for c in OUTPUTS]),
    ("command", [Signal(f"Command.{wheel}", "") for wheel in ("FL", "FR", "RL", "RR")]),
)


@dataclass(frozen=True)
class Result:
    steps_done: int
    simulated_s: float
    wall_time_s: float = 0.5
    lap_time_s: float | None = 1.99
    largest_deviation_m: float = 0.2
    finish_reason: str = "duration reached"
    comfort: Mapping[str, Any] = field(
        default_factory=lambda: {
            "weighted_acceleration_m_s2": 0.61,
            "deflection_rms_m": 0.0081,
            "tyre_load_rms_n": 512.0,
        }
    )
    manoeuvre: Mapping[str, Any] = field(default_factory=dict)
    grip: Mapping[str, Any] = field(default_factory=dict)
    timing: Mapping[str, Any] = field(default_factory=lambda: {"step_p99_ms": 0.7})
    bus: Mapping[str, Any] = field(default_factory=dict)


@dataclass
class StandIn:
    """An assembly whose estimate is the truth times `gain`, valid once the window is full."""

    rows: int = 200
    gain: float = 0.9
    fails_at: int | None = None
    files: Mapping[str, Path] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.recorder = Recorder(GROUPS, self.rows)
        self.initial_command = np.zeros(4)

    def run(self, progress: Callable[[int, int], None] | None) -> Result:
        for k in range(self.rows):
            if k == self.fails_at:
                raise FmuError("the vehicle FMU stopped at 0.5 s: the car has rolled over")
            truth = 0.1 * np.sin(0.3 * k + np.arange(4))
            valid = k >= WINDOW - 1
            estimate = self.gain * truth if valid else np.full(4, np.nan)
            self.recorder.append(k, np.full(14, 0.01), estimate, valid, truth, np.zeros(4))
            if progress is not None:
                progress(k, self.rows - 1)
        return Result(self.rows - 1, (self.rows - 1) * 0.01)


def assemble(scenario: Scenario, controller: Any) -> StandIn:
    return StandIn()
