"""What a windowed network is trained on: a recipe's runs, as the network sees them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sensor.conditions import Measurement
from sensor.dataset import Normalisation, Run, WindowSet, read_runs, split
from sensor.errors import SensorError
from sensor.features import with_residuals
from sensor.recipe import Recipe, RunSelection


def read_parts(data: Path, selection: RunSelection) -> tuple[list[Run], list[Run]]:
    """Read the training and the validation runs; raises SensorError if files are missing."""
    training = read_runs(data, selection.training)
    if selection.hold_out is None:
        return training, read_runs(data, selection.validation)
    step = selection.hold_out
    if len(training) < step:
        raise SensorError(
            f"{data}: of {step} runs one is held out for validation, but there are {len(training)}."
        )
    return split(training, step)


def window_sets(
    recipe: Recipe, training: Sequence[Run], validation: Sequence[Run]
) -> tuple[WindowSet, WindowSet]:
    """Return the training and the validation windows as the network sees them, both standardised by
    the training runs.
    """
    seen = as_seen(recipe, training), as_seen(recipe, validation)
    normalisation, window = Normalisation.of(seen[0]), recipe.network.window
    return WindowSet(seen[0], window, normalisation), WindowSet(seen[1], window, normalisation)


def as_seen(recipe: Recipe, runs: Sequence[Run], draw: int = 0) -> list[Run]:
    """Return the runs with the channels that the network standardises: measured in the recipe's
    condition, with residuals in place of the wheel speeds where it wants them. Every `draw` has
    measurement errors of its own.
    """
    seen = []
    for run in runs:
        seeds = np.random.SeedSequence([recipe.seed, draw, *run.name.encode()])
        measurement = Measurement(recipe.condition, int(seeds.generate_state(1)[0]))
        channels = measurement.apply(run.channels, run.stage)
        if recipe.network.channels == "residual":
            channels = with_residuals(channels)
        seen.append(replace(run, channels=channels.astype(np.float32)))
    return seen
