"""Train the network: `python -m sensor.train --data DIR --recipe RECIPE.yaml --out DIR`."""

import os
import sys
from pathlib import Path

import click

from sensor.errors import SensorError


@click.command(help=__doc__)
@click.option(
    "--data", required=True, type=click.Path(path_type=Path), help="Directory of Parquet files."
)
@click.option("--recipe", required=True, type=click.Path(path_type=Path), help="Recipe (YAML).")
@click.option(
    "--out", required=True, type=click.Path(path_type=Path), help="Directory for the results."
)
@click.option("--resume", is_flag=True, help="Go on from the checkpoint in the results directory.")
def main(data: Path, recipe: Path, out: Path, resume: bool) -> None:
    """Train by a recipe; exit code 2 with one sentence per problem if the recipe or the data do not
    fit.
    """
    # Read when torch is loaded. Threads that spin while waiting make training up to 20 times
    # slower as soon as another process wants the same cores.
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    os.environ.setdefault("GOMP_SPINCOUNT", "0")
    from sensor.training import train

    try:
        train(data, recipe, out, resume=resume)
    except SensorError as error:
        click.echo(str(error), err=True)
        sys.exit(2)


if __name__ == "__main__":
    main()
