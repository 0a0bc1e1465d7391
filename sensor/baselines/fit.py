"""Fit the linear filters by ridge regression; the best ridge in validation is kept.

`python -m sensor.baselines.fit --data DIR --recipe RECIPE.yaml --out DIR` fits them all.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil
from pathlib import Path
from typing import Final

import click
import numpy as np

from sensor.baselines.fir import FirFilter
from sensor.baselines.normal_equations import (
    Array,
    Features,
    NormalEquations,
    Samples,
    Standard,
)
from sensor.baselines.recipe import RIDGES, read_fir
from sensor.channels import CHANNELS, OUTPUTS
from sensor.conditions import CONDITIONS, Condition
from sensor.dataset import Run, read_runs, split
from sensor.errors import SensorError
from sensor.provenance import versions


@dataclass(frozen=True)
class Shape:
    """A filter's window [samples], and what stands in the places of the wheel speeds."""

    window: int
    channels: Features


FILTERS: Final[Mapping[str, Shape]] = {
    "fir_w19": Shape(19, "raw"),
    "fir_w64": Shape(64, "raw"),
    "fir_residual_w19": Shape(19, "residual"),
    "fir_residual_w64": Shape(64, "residual"),
}
"""The filters that are shipped, by name."""

FLOOR: Final = 0.03
"""Truth rms [m/s] below which runs hardly count more: a run weighs 1 / (rms^2 + FLOOR^2). With all
alike, speed humps decide and flat turns are lost; with the networks' 4 mm/s flat turns decide, and
the filter gives up too much on rough roads.
"""
DRAWS: Final = 120
"""In condition production runs are measured again and again, each time with other offsets and
noise, until there are that many draws; with few, a filter learns to trust the offsets it has seen.
"""


def train(
    data: Path, recipe: Path, out: Path, command: str, tell: Callable[[str], None] = print
) -> list[Path]:
    """Fit every filter of `FILTERS` for both conditions on a recipe's runs in `data`, write
    `<name>_<condition>.npz` with the `command` that made it to `out`, and return the files.

    Raises SensorError if the recipe or the data do not fit.
    """
    settings = read_fir(recipe)
    training, validation = split(read_runs(data, settings.runs), settings.hold_out)
    out.mkdir(parents=True, exist_ok=True)
    files = []
    for name, shape in FILTERS.items():
        for condition in CONDITIONS:
            fir = fit_best(shape, condition, training, validation, settings.ridges)
            fir.training |= {"command": command, "recipe": settings.model_dump(mode="json")}
            path = out / f"{name}_{condition}.npz"
            fir.save(path)
            error = 1e3 * fir.training["validation_rmse"]
            tell(f"{path}: ridge {fir.training['ridge']:g}, validation {error:.2f} mm/s")
            files.append(path)
    return files


def fit_best(
    shape: Shape,
    condition: Condition,
    training: Sequence[Run],
    validation: Sequence[Run],
    ridges: Sequence[float] = RIDGES,
) -> FirFilter:
    """Solve for each ridge and return the filter with the least RMSE in validation, all wheels
    pooled and quiet runs weighted as in training; raises SensorError if no run is as long as the
    window.
    """
    fitted, checked = equations(shape, condition, training, validation, FLOOR)
    solutions = [fitted.solve(ridge) for ridge in ridges]
    errors = [pooled(checked.rmse(solution)) for solution in solutions]
    best = int(np.argmin(errors))
    record = {
        "condition": condition,
        "ridge": ridges[best],
        "floor": FLOOR,
        "validation_rmse": errors[best],
        "training_runs": len(training),
        "validation_runs": [run.name for run in validation],
        "versions": versions(),
    }
    weights, bias = in_physical_units(fitted, solutions[best])
    return FirFilter(weights, bias, record, shape.channels)


def equations(
    shape: Shape,
    condition: Condition,
    training: Sequence[Run],
    validation: Sequence[Run],
    floor: float | None = None,
) -> tuple[NormalEquations, NormalEquations]:
    """Return the normal equations over the training runs, weighted by FLOOR, and over the
    validation runs, weighted by `floor` if at all, standardised alike.
    """
    shown, unseen = (
        Samples(runs, condition, shape.channels, ceil(DRAWS / max(len(runs), 1)))
        for runs in (training, validation)
    )
    standard = Standard.of(shown)
    fitted = NormalEquations.of(shown, shape.window, standard, FLOOR)
    return fitted, NormalEquations.of(unseen, shape.window, standard, floor)


def in_physical_units(fitted: NormalEquations, solution: Array) -> tuple[Array, Array]:
    """Return weights (W, 14, 4) and bias (4,) [m/s] with the standardisation worked in."""
    s = fitted.standard
    weights = solution[:-1].reshape(fitted.window, len(CHANNELS), len(OUTPUTS))
    weights = weights * s.output_std / s.input_std[:, np.newaxis]
    bias = solution[-1] * s.output_std + s.output_mean
    return weights, bias - np.einsum("wco,c->o", weights, s.input_mean)


def pooled(errors: Array) -> float:
    """Return one root mean square [m/s] for those of the wheels (4,)."""
    return float(np.sqrt(np.mean(np.square(errors))))


@click.command(help="Fit the linear filters on a recipe's runs, for both conditions.")
@click.option("--data", required=True, type=click.Path(path_type=Path), help="Parquet files.")
@click.option("--recipe", required=True, type=click.Path(path_type=Path), help="Recipe (YAML).")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Where filters go.")
def main(data: Path, recipe: Path, out: Path) -> None:
    """Fit; exit code 2 with one sentence per problem if the recipe or the data do not fit."""
    command = f"python -m sensor.baselines.fit --data {data.name} --recipe {recipe.name}"
    try:
        train(data, recipe, out, command, partial(click.echo, err=True))
    except SensorError as error:
        click.echo(str(error), err=True)
        sys.exit(2)


if __name__ == "__main__":
    main()
