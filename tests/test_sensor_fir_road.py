"""Linear filters on runs of the vehicle over a rough road: what its channels really carry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from loop_rig import Blind

from cosim.assembly import assemble
from cosim.recorder import held
from cosim.scenario.load import load
from sensor.ablation import ablation
from sensor.baselines.fit import Shape, fit_best, pooled
from sensor.baselines.normal_equations import Features
from sensor.channels import ROAD, STAGE
from sensor.conditions import CONDITIONS, Condition, Measurement
from sensor.dataset import Run

RURAL = Path(__file__).parents[1] / "scenarios" / "paper" / "rural_aggressive.yaml"


def driven(name: str, seed: int) -> Run:
    """Twenty seconds of speeding up, cornering and braking on class B, uneven by its own seed."""
    scenario = load(RURAL, ["duration=20", "road.surface=B", f"seed={seed}"])
    assembly = assemble(scenario, scenario.controllers[0], Blind())
    assembly.run(None)
    record = assembly.recorder
    return Run(
        name,
        channels=record.group("channels").astype(np.float32),
        stage=record.columns([signal.name for signal in STAGE]).astype(np.float32),
        commands=held(record.group("command"), assembly.initial_command).astype(np.float32),
        truth=record.group("truth").astype(np.float32),
        road=record.columns([signal.name for signal in ROAD]).astype(np.float32),
    )


@pytest.fixture(scope="module")
def runs() -> tuple[list[Run], list[Run], Run]:
    """Training, validation (seen, which the test does not depend on), and a run never seen."""
    training = [driven("a", 11), driven("b", 12)]
    return training, training[-1:], driven("c", 13)


def error(
    runs: tuple[list[Run], list[Run], Run], channels: Features, condition: Condition
) -> float:
    """RMSE on the unseen run over the rms of its truth."""
    training, validation, unseen = runs
    fir = fit_best(Shape(19, channels), condition, training, validation)
    measured = Measurement(condition, 99).apply(unseen.channels, unseen.stage)
    estimate = fir.apply(measured, unseen.commands)[18:]
    truth = unseen.truth[18:].astype(np.float64)
    return pooled(estimate - truth) / pooled(truth)


@pytest.mark.parametrize("condition", CONDITIONS)
def test_residual_channels_beat_raw_ones(
    runs: tuple[list[Run], list[Run], Run], condition: Condition
) -> None:
    """In production hardly, with one car on one road: a linear filter takes the driving out of the
    wheel speeds by itself, all but the products of speed with steering and slip.
    """
    residual, raw = (error(runs, kind, condition) for kind in ("residual", "raw"))
    assert residual < raw * (1.0 if condition == "ideal" else 1.05)
    assert raw < 0.6


def test_wheel_speeds_carry_most_and_accelerations_some(
    runs: tuple[list[Run], list[Run], Run],
) -> None:
    training, _, unseen = runs
    found = {a.without: a for a in ablation("ideal", training, [unseen])}
    for a in found.values():
        print(a)
    assert found["wheel speeds"].rmse > 1.1 * found[None].rmse
    assert found["IMU accelerations"].rmse > 1.1 * found[None].rmse
