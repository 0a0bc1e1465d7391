"""Fit the linear filter: `python -m sensor.baselines.fit --data DIR --recipe RECIPE.yaml --out
DIR`.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import click
import numpy as np

from sensor.baselines.fir import FirFilter, NormalEquations
from sensor.dataset import Normalisation, Run, read_runs
from sensor.errors import SensorError
from sensor.metrics import rmse
from sensor.recipe import FirRecipe, read_recipe


def fit_best(recipe: FirRecipe, training: Sequence[Run], validation: Sequence[Run]) -> FirFilter:
    """Solve for each ridge of the recipe and return the filter with the least RMSE in validation,
    all wheels pooled.
    """
    equations = NormalEquations.of(training, recipe.window, Normalisation.of(training))
    filters = [equations.solve(ridge) for ridge in recipe.ridges]
    errors = [_pooled_rmse(fir, validation) for fir in filters]
    best = int(np.argmin(errors))
    filters[best].training |= {
        "validation_rmse": errors[best],
        "training_runs": [run.name for run in training],
        "validation_runs": [run.name for run in validation],
    }
    return filters[best]


def _pooled_rmse(fir: FirFilter, runs: Sequence[Run]) -> float:
    first = fir.window - 1
    estimates = np.concatenate(
        [fir.apply(run.channels, np.zeros((len(run.channels), 4)))[first:] for run in runs]
    )
    return rmse(estimates, np.concatenate([run.truth[first:] for run in runs]).astype(np.float64))


@click.command(help=__doc__)
@click.option(
    "--data", required=True, type=click.Path(path_type=Path), help="Directory of Parquet files."
)
@click.option("--recipe", required=True, type=click.Path(path_type=Path), help="Recipe (YAML).")
@click.option(
    "--out", required=True, type=click.Path(path_type=Path), help="Directory for the filter."
)
def main(data: Path, recipe: Path, out: Path) -> None:
    """Fit by a recipe; exit code 2 with one sentence per problem if the recipe or the data do not
    fit.
    """
    try:
        settings = read_recipe(recipe)
        runs = [
            read_runs(data, part) for part in (settings.runs.training, settings.runs.validation)
        ]
        fir = fit_best(settings.fir, *runs)
    except SensorError as error:
        click.echo(str(error), err=True)
        sys.exit(2)
    out.mkdir(parents=True, exist_ok=True)
    path = out / f"fir_w{fir.window}.npz"
    fir.save(path)
    figure = 1e3 * fir.training["validation_rmse"]
    click.echo(f"{path}: ridge {fir.training['ridge']:g}, validation {figure:.2f} mm/s", err=True)


if __name__ == "__main__":
    main()
