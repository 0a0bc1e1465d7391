"""Fit the linear filters by ridge regression; the best ridge in validation is kept.

`python -m sensor.baselines.fit --data DIR --recipe RECIPE.yaml --out DIR` fits them all.
"""

import sys
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Final

import click
import numpy as np

from sensor.baselines.fir import FirFilter
from sensor.baselines.normal_equations import Array, NormalEquations, Samples, Standard
from sensor.channels import CHANNELS, OUTPUTS
from sensor.conditions import CONDITIONS, Condition
from sensor.dataset import Run, read_runs
from sensor.errors import SensorError
from sensor.provenance import versions
from sensor.recipe import FirRecipe, read_recipe

FILTERS: Final[Mapping[str, FirRecipe]] = {
    "fir_w19": FirRecipe(window=19, channels="raw"),
    "fir_w64": FirRecipe(window=64, channels="raw"),
    "fir_residual_w19": FirRecipe(window=19, channels="residual"),
    "fir_residual_w64": FirRecipe(window=64, channels="residual"),
}
"""The filters that are shipped, by name."""

REPEATS: Final = 3  # of each training run with other offsets and noise, in condition production


def fit_best(
    recipe: FirRecipe,
    condition: Condition,
    training: Iterable[Run],
    validation: Iterable[Run],
) -> FirFilter:
    """Solve for each ridge of the recipe and return the filter with the least RMSE in validation,
    all wheels pooled.

    The runs are gone through twice, so a generator will not do. Raises SensorError if none is as
    long as the window.
    """
    fitted, checked = equations(recipe, condition, training, validation)
    solutions = [fitted.solve(ridge) for ridge in recipe.ridges]
    errors = [pooled(checked.rmse(solution)) for solution in solutions]
    best = int(np.argmin(errors))
    record = {
        "condition": condition,
        "ridge": recipe.ridges[best],
        "windows": fitted.count,
        "validation_rmse": errors[best],
        "training_runs": [run.name for run in training],
        "validation_runs": [run.name for run in validation],
        "versions": versions(),
    }
    weights, bias = in_physical_units(fitted, solutions[best])
    return FirFilter(weights, bias, record, recipe.channels)


def fit_all(
    training: Iterable[Run],
    validation: Iterable[Run],
    directory: Path,
    command: str,
    tell: Callable[[str], None] = lambda line: None,
) -> list[Path]:
    """Fit every filter of `FILTERS` for both conditions, write `<name>_<condition>.npz` with the
    `command` that made it, and return the files.
    """
    directory.mkdir(parents=True, exist_ok=True)
    files = []
    for name, recipe in FILTERS.items():
        for condition in CONDITIONS:
            fir = fit_best(recipe, condition, training, validation)
            fir.training["command"] = command
            path = directory / f"{name}_{condition}.npz"
            fir.save(path)
            error = 1e3 * fir.training["validation_rmse"]
            tell(f"{path}: ridge {fir.training['ridge']:g}, validation {error:.2f} mm/s")
            files.append(path)
    return files


def equations(
    recipe: FirRecipe,
    condition: Condition,
    training: Iterable[Run],
    validation: Iterable[Run],
) -> tuple[NormalEquations, NormalEquations]:
    """Return the normal equations over the training and over the validation runs, standardised
    alike.
    """
    shown = Samples(training, condition, recipe.channels, REPEATS)
    unseen = Samples(validation, condition, recipe.channels)
    standard = Standard.of(shown)
    fitted = NormalEquations.of(shown, recipe.window, standard)
    return fitted, NormalEquations.of(unseen, recipe.window, standard)


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
    try:
        runs = read_recipe(recipe).runs
        training, validation = (read_runs(data, part) for part in (runs.training, runs.validation))
        command = f"python -m sensor.baselines.fit --data {data.name} --recipe {recipe.name}"
        fit_all(training, validation, out, command, partial(click.echo, err=True))
    except SensorError as error:
        click.echo(str(error), err=True)
        sys.exit(2)


if __name__ == "__main__":
    main()
