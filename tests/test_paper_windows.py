"""Why a longer window did not help the paper: what a linear filter gains from each length."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from loop_rig import Blind

from cosim.assembly import assemble
from cosim.recorder import held
from cosim.scenario.load import load
from sensor.baselines.normal_equations import NormalEquations, Samples, Standard
from sensor.channels import CHANNELS, ROAD, SAMPLE_RATE_HZ, STAGE
from sensor.dataset import Run
from sensor.paper.reading import WHEELBASE_M

SCENARIO = Path(__file__).parents[1] / "scenarios" / "road" / "class_b_50.yaml"
LONGEST = 40
RIDGE = 1e-7


def driven(seed: int, kmh: float, duration: int) -> Run:
    """Straight ahead at constant speed on 600 m of class B road of its own."""
    changes = [f"duration={duration}", f"seed={seed}", f"driver.speed_kmh={kmh}"]
    scenario = load(SCENARIO, changes)
    assembly = assemble(scenario, scenario.controllers[0], Blind())
    assembly.run(None)
    record = assembly.recorder
    return Run(
        f"{kmh}_{seed}",
        channels=record.group("channels").astype(np.float32),
        stage=record.columns([signal.name for signal in STAGE]).astype(np.float32),
        commands=held(record.group("command"), assembly.initial_command).astype(np.float32),
        truth=record.group("truth").astype(np.float32),
        road=record.columns([signal.name for signal in ROAD]).astype(np.float32),
    )


def accuracies(training: list[Run], unseen: Run) -> dict[int, float]:
    """Accuracy [%] of the linear filter on the unseen run, for windows of 7 to LONGEST samples."""
    standard = Standard.of(Samples(training))
    fitted, checked = (
        NormalEquations.of(Samples(runs), LONGEST, standard) for runs in (training, [unseen])
    )
    truth = np.sqrt(np.mean(np.square(unseen.truth[LONGEST - 1 :])))
    found = {}
    for window in (7, 13, 17, 19, 21, 25, 40):
        gone = (LONGEST - window) * len(CHANNELS)
        gram, moment = fitted.gram.copy(), fitted.moment.copy()
        gram[:gone], gram[:, :gone], moment[:gone] = 0.0, 0.0, 0.0
        error = checked.rmse(replace(fitted, gram=gram, moment=moment).solve(RIDGE))
        found[window] = 100.0 * (1.0 - float(np.sqrt(np.mean(error**2)) / truth))
    return found


@pytest.fixture(scope="module")
def at_50() -> tuple[list[Run], Run]:
    return [driven(11, 50.0, 40), driven(12, 50.0, 40)], driven(13, 50.0, 30)


def test_at_one_speed_the_window_that_sees_the_delay_is_the_better_one(
    at_50: tuple[list[Run], Run],
) -> None:
    """At 50 km/h the rear wheels follow 19.3 samples behind the front ones: a window of 19 just
    misses that, one of 21 sees it, and nothing more comes with longer ones.
    """
    delay = WHEELBASE_M / (50.0 / 3.6) * SAMPLE_RATE_HZ
    assert 19.0 < delay < 20.0
    found = accuracies(*at_50)
    assert found[21] > found[19] + 2.0
    assert found[19] < found[17] + 1.5
    assert found[40] < found[25] + 0.5


def test_at_changing_speeds_a_longer_window_gives_a_linear_filter_nothing(
    at_50: tuple[list[Run], Run],
) -> None:
    training = [*at_50[0], driven(21, 70.0, 25), driven(22, 90.0, 20)]
    found = accuracies(training, driven(31, 60.0, 25))
    assert found[40] < found[19] + 1.0
