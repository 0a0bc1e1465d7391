"""What makes the network with carried state good: one thing taken away or added at a time, three
seeds each: `make study` (about an hour of one core; resumes where it was stopped).

Writes docs/carried-study.md. Small networks, short trainings and a part of the training data: the
differences count, not the level.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
os.environ.setdefault("GOMP_SPINCOUNT", "0")

import click
import numpy as np
import numpy.typing as npt

from sensor.carried.features import FeatureConfig, features, taken
from sensor.carried.recipe import CarriedRecipe, Schedule, Shape
from sensor.channels import CHANNEL_NAMES
from sensor.dataset import Run, read_runs, split

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "carried-study.md"
RESULTS = ROOT / "docs" / "carried-study.json"
SEEDS = (1, 2, 3)
EPOCHS = 6
TRAINING = (
    "straight_passive_*", "straight_switching_*", "mix_passive_*", "mix_more_passive_*",
    "turn_passive_*", "slalom_passive_*", "sine_with_dwell_passive_*", "bumps_passive_*",
)  # fmt: skip
CASES = {
    "mix A": "mix_a_passive_*",
    "mix B": "mix_b_passive_*",
    "B 50 km/h": "straight_b_050_passive_*",
    "C 50 km/h": "straight_c_050_passive_*",
    "bumpy": "bumpy_road_*_smooth_passive",
    "sine with dwell A": "sine_with_dwell_*_class_a_passive",
    "flat turns, mm/s": "flat_turn_passive_*",
}
WHEELS = [CHANNEL_NAMES.index(f"Car.v{wheel}") for wheel in ("FL", "FR", "RL", "RR")]
Prepare = Callable[[Run, npt.NDArray[np.float64]], npt.NDArray[np.float32]]


@dataclass(frozen=True)
class Variant:
    """One training: what its features are made of, and how it is trained."""

    name: str
    what: str
    raw: bool = False  # wheel speeds instead of their residuals
    without: tuple[str, ...] = ()
    level: bool = True
    feedback: bool = False
    kalman: bool = False
    floor: float | None = 0.004
    epochs: int = EPOCHS
    mirror: bool = False


_DELAY, _DIFFERENCES = "@", "d"
FULL = Variant("shipped", "the recipe's features and loss")
VARIANTS = (
    Variant("raw", "wheel speeds as they are; no delay line, no differences, no level", raw=True,
            without=(_DELAY, _DIFFERENCES), level=False),
    Variant("residuals", "wheel-speed residuals instead", without=(_DELAY, _DIFFERENCES),
            level=False),
    Variant("delay", "and the delay line", without=(_DIFFERENCES,), level=False),
    Variant("differences", "and differences from sample to sample", level=False),
    replace(FULL, what="and all of it relative to the level of motion: the recipe"),
    replace(FULL, name="no delay line", what="the recipe without the delay line",
            without=(_DELAY,)),
    replace(FULL, name="no commands", what="the recipe without damper commands",
            without=("Damper",)),
    replace(FULL, name="plain loss", what="every sample's error counts alike", floor=None),
    replace(FULL, name="feedback", feedback=True, epochs=EPOCHS // 2,
            what="half the epochs, then as many again with its own delayed estimate"),
    replace(FULL, name="Kalman", kalman=True,
            what="with the Kalman filter's estimate"),
    replace(FULL, name="longer", what="twice the epochs", epochs=2 * EPOCHS),
    replace(FULL, name="mirror", what="mirror images among the runs", mirror=True),
    replace(FULL, name="longer with mirror", what="both", epochs=2 * EPOCHS, mirror=True),
)  # fmt: skip


@dataclass(frozen=True)
class WiderConfig(FeatureConfig):
    """The features, and `extra` more behind them."""

    extra: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the features, in their order."""
        return (*super().names, *(f"extra {i}" for i in range(self.extra)))


@click.command(help=__doc__)
@click.option("--data", type=click.Path(path_type=Path), default=ROOT / "data" / "own")
@click.option("--evaluation", type=click.Path(path_type=Path), default=ROOT / "data" / "evaluation")
@click.option("--only", help="One variant by name.")
def main(data: Path, evaluation: Path, only: str | None) -> None:
    """Train what is missing, then write the page."""
    results: dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.is_file() else {}
    for seed in SEEDS:
        for variant in VARIANTS:
            key = f"{variant.name} {seed}"
            if key in results or (only and variant.name != only):
                continue
            results[key] = trained_and_judged(variant, seed, data, evaluation)
            RESULTS.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
            print(key, results[key], flush=True)
    PAGE.write_text(page(results), encoding="utf-8")


@cache
def runs(folder: Path, patterns: tuple[str, ...]) -> tuple[Run, ...]:
    """Read runs once."""
    return tuple(read_runs(folder, patterns))


def trained_and_judged(
    variant: Variant, seed: int, data: Path, evaluation: Path
) -> dict[str, float]:
    """Train one variant and return its accuracy [%] by case (RMSE [mm/s] on flat turns)."""
    training = runs(data, TRAINING)
    prepare: Prepare = partial(prepared, variant)
    network = fit(variant, seed, training, prepare, 4 if variant.kalman else 0)
    if variant.feedback:
        first = network
        prepare = partial(with_feedback, variant, first)
        network = fit(variant, seed, training, prepare, 2 * len(_FEEDBACK_LEADS))
    return {
        case: judged(network, prepare, runs(evaluation, (pattern,)), "mm/s" in case)
        for case, pattern in CASES.items()
    }


def fit(variant: Variant, seed: int, training: Sequence[Run], prepare: Prepare, extra: int) -> Any:
    """Train a small network on features made by `prepare`."""
    from sensor.carried.network import CarriedConfig, CarriedNetwork
    from sensor.carried.training import Trainer

    schedule = Schedule(
        epochs=variant.epochs, learning_rate=6e-3, weight_floor=variant.floor, mirror=variant.mirror
    )
    recipe = CarriedRecipe(
        family="carried", name="study", condition="ideal", seed=seed,
        network=Shape(front=48, units=64, hidden=48), training=schedule,
    )  # fmt: skip

    class StudyTrainer(Trainer):
        def build(self) -> CarriedNetwork:
            shape = recipe.network
            config = WiderConfig(extra=extra)
            return CarriedNetwork(CarriedConfig(shape.front, shape.units, shape.hidden, config))

        def features(self, run: Run, measured: Any) -> Any:
            return prepare(run, measured)

    training, held = split(training, recipe.hold_out)
    trainer = StudyTrainer(recipe, training, held)
    for epoch in range(schedule.epochs):
        trainer.run_epoch(epoch)
    return trainer.finished()


def prepared(
    variant: Variant, run: Run, measured: npt.NDArray[np.float64]
) -> npt.NDArray[np.float32]:
    """Features of a run for one variant."""
    config = FeatureConfig()
    rows = features(measured, run.commands, config)
    names = np.array([*config.names, "level"])
    if not variant.level:
        first = list(names).index("Residual.FL")
        rows[:, first:-1] *= rows[:, -1:]
        rows[:, -1] = 1.0
    if variant.raw:
        rows[:, [list(names).index(f"Residual.{w}") for w in ("FL", "FR", "RL", "RR")]] = (
            measured[:, WHEELS] / 30.0
        )
    for group in variant.without:
        gone = [
            (name.startswith(("d ", "d2 ")) if group == _DIFFERENCES else group in name)
            for name in names
        ]
        rows[:, gone] = 0.0
    if variant.kalman:
        return _inserted(rows, _kalman(run.name, run, measured) / rows[:, -1:] / 0.05)
    return rows


def _inserted(rows: Any, extra: Any) -> npt.NDArray[np.float32]:
    """Put more features before the level, which is last."""
    return np.hstack([rows[:, :-1], extra, rows[:, -1:]]).astype(np.float32)


_KALMAN: dict[str, npt.NDArray[np.float32]] = {}


def _kalman(name: str, run: Run, measured: npt.NDArray[np.float64]) -> npt.NDArray[np.float32]:
    from sensor.estimators import make

    if name not in _KALMAN:
        estimate = make("kalman", "ideal").apply(measured, run.commands.astype(np.float64))
        _KALMAN[name] = np.nan_to_num(estimate).astype(np.float32)
    return _KALMAN[name]


_FEEDBACK_LEADS = (-4, -2, 0, 2, 4, 6, 8)


def with_feedback(
    variant: Variant, first: Any, run: Run, measured: npt.NDArray[np.float64]
) -> npt.NDArray[np.float32]:
    """Features, and the first network's front estimates one wheelbase ago."""
    rows = prepared(variant, run, measured)
    front = estimated(first, rows)[:, :2].astype(np.float64)
    config = FeatureConfig()
    speed = np.maximum(measured[:, CHANNEL_NAMES.index("Car.vx")], config.least_speed)
    delay = config.wheelbase * 100.0 / speed
    delayed = [
        taken(front, np.clip(delay - lead, 0.0, config.depth - 3.0)) for lead in _FEEDBACK_LEADS
    ]
    return _inserted(rows, np.hstack(delayed) / rows[:, -1:] / 0.05)


def estimated(network: Any, rows: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Velocities (samples, 4) [m/s]."""
    import torch

    with torch.no_grad():
        return np.asarray(network(torch.from_numpy(rows)[:, None])[0][:, 0])


def judged(network: Any, prepare: Prepare, cases: Sequence[Run], absolute: bool) -> float:
    """Accuracy [%], or RMSE [mm/s], over the runs pooled, without their first second."""
    squares, truths, count = 0.0, 0.0, 0
    for run in cases:
        rows = prepare(run, run.measured("ideal", 0))
        error = (estimated(network, rows) - run.truth)[100:]
        squares += float(np.square(error).sum())
        truths += float(np.square(run.truth[100:]).sum())
        count += error.size
    if absolute:
        return round(1e3 * float(np.sqrt(squares / count)), 2)
    return round(100 * (1 - float(np.sqrt(squares / truths))), 2)


def page(results: dict[str, Any]) -> str:
    """Return docs/carried-study.md."""
    samples = "small networks (64 units), short trainings, a fifth of the training data"
    text = (
        "# What makes the network with carried state good\n\n"
        f"Written by `make study`: {samples}, condition ideal. Accuracy in % (flat turns: RMSE in "
        "mm/s), mean of three seeds and, in brackets, half the spread between the best and the "
        "worst; differences count, not the level.\n\n"
        f"| variant | {' | '.join(CASES)} |\n|---|{'---|' * len(CASES)}\n"
    )
    for variant in VARIANTS:
        found = [results[k] for s in SEEDS if (k := f"{variant.name} {s}") in results]
        if not found:
            continue
        cells = []
        for case in CASES:
            values = [one[case] for one in found]
            cells.append(f"{np.mean(values):.1f} ({0.5 * (max(values) - min(values)):.1f})")
        text += f"| **{variant.name}**: {variant.what} | {' | '.join(cells)} |\n"
    return text


if __name__ == "__main__":
    main()
