"""Every estimator on every recorded run under every measurement condition, on the same samples.

`evaluate_run` returns the figures of one run as plain numbers for JSON; what they are is told in
`sensor.metrics`. All velocities are in m/s, accuracies, shares and coverage in %.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNEL_NAMES, OUTPUT_NAMES
from sensor.conditions import Condition, Measurement
from sensor.dataset import Run, read_run
from sensor.errors import SensorError
from sensor.estimator import Estimator
from sensor.estimators import make
from sensor.metrics import by_band, by_mode, coverage, evaluate, projected

Array = npt.NDArray[np.float64]
Pair = tuple[Condition, str]

WARM_UP = 100
"""Samples at the beginning of a run that count for no estimator: all are valid by then, and which
samples count does not depend on who is compared.
"""
_SPEED = CHANNEL_NAMES.index("Car.vx")


@dataclass(frozen=True)
class Estimate:
    """What an estimator makes of a run: `velocities` and predicted `deviation` (samples, 4) [m/s],
    NaN where there is none.
    """

    velocities: Array
    deviation: Array


def evaluate_run(path: Path, pairs: Sequence[Pair]) -> dict[str, Any]:
    """Apply estimators, each as a pair of condition and name, to one run's file; return its record:
    {"name", "recipe", "samples", "figures": {condition: {estimator: figures}}}.

    Raises SensorError if the file does not fit, or is no longer than the warm-up, or if an
    estimator has no estimate after it.
    """
    run = read_run(path)
    if len(run.truth) <= WARM_UP:
        raise SensorError(f"{path}: {len(run.truth)} samples are not more than {WARM_UP}.")
    found: dict[str, dict[str, Any]] = {condition: {} for condition, _ in pairs}
    for condition in found:
        measured = measured_channels(run, condition)
        for name in (name for place, name in pairs if place == condition):
            one = estimate(_estimator(name, condition), measured, run)
            if not np.isfinite(one.velocities[WARM_UP:]).all():
                raise SensorError(
                    f"{path}: after {WARM_UP} samples {name!r} still has none or a lost estimate."
                )
            found[condition][name] = figures(run, one, measured[:, _SPEED])
    return {
        "name": run.name,
        "recipe": dict(run.recipe),
        "samples": len(run.truth) - WARM_UP,
        "figures": found,
    }


def estimate(estimator: Estimator, measured: Array, run: Run) -> Estimate:
    """Apply an estimator to what was measured in a run (samples, 14)."""
    commands = run.commands.astype(np.float64)
    both: Callable[[Array, Array], tuple[Array, Array]] | None
    both = getattr(estimator, "apply_with_deviation", None)
    if both is not None:
        return Estimate(*both(measured, commands))
    velocities = estimator.apply(measured, commands)
    return Estimate(velocities, np.full_like(velocities, np.nan))


def measured_channels(run: Run, condition: str) -> Array:
    """Return what is measured of a run (samples, 14); a digest of its name seeds the errors."""
    seed = int.from_bytes(hashlib.sha256(run.name.encode()).digest()[:4])
    return Measurement(condition, seed).apply(run.channels, run.stage)


def figures(run: Run, one: Estimate, measured_speed: Array) -> Mapping[str, Any]:
    """Return the figures of one estimator after the warm-up, as plain numbers.

    `measured_speed` (samples,) [m/s] is what the sensor knows of the speed.
    """
    truth = run.truth[WARM_UP:].astype(np.float64)
    true_speed = run.channels[WARM_UP:, _SPEED].astype(np.float64)
    velocities = one.velocities[WARM_UP:]
    on_target = projected(velocities, truth, measured_speed[WARM_UP:], true_speed)
    share = coverage(velocities - truth, one.deviation[WARM_UP:])
    return {
        **evaluate(velocities, truth).to_dict(),
        "modes": {name: part.to_dict() for name, part in by_mode(velocities, truth).items()},
        "bands": {name: part.to_dict() for name, part in by_band(velocities, truth).items()},
        "projected": on_target.to_dict(),
        "coverage": share if share is None else dict(zip(OUTPUT_NAMES, share, strict=True)),
    }


@cache
def _estimator(name: str, condition: Condition) -> Estimator:
    """One estimator for all runs of a process; `apply` starts afresh each time."""
    return make(name, condition)
