"""The commands of the virtual sensor; heavy packages are imported where they are used."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from cosim.exit_codes import cores, failures_as_exit_codes, one_thread, threads_that_sleep

_DIRECTORY = click.Path(path_type=Path, file_okay=False)


@click.group()
def sensor() -> None:
    """Data sets, training and evaluation of the virtual sensor."""


@sensor.command()
@click.argument("recipe", type=click.Path(path_type=Path))
@click.option(
    "--out",
    metavar="DIR",
    required=True,
    type=_DIRECTORY,
    help="Where the Parquet files go, one per run; runs that are there already are kept.",
)
@click.option(
    "--jobs",
    metavar="N",
    type=click.IntRange(1),
    help="Drive up to N runs at the same time, as many as there are cores by default.",
)
def dataset(recipe: Path, out: Path, jobs: int | None) -> None:
    """Drive the runs of RECIPE, a YAML file, and write them as data for training.

    A run that is in DIR from the same values, scenario and vehicle FMU is not driven again. One
    that fails is named at the end; the others are written all the same.
    """
    one_thread()
    with failures_as_exit_codes():
        from cosim.dataset.command import run

        code = run(recipe, out, jobs or cores())
    sys.exit(code)


@sensor.command()
@click.option(
    "--data",
    metavar="DIR",
    required=True,
    type=click.Path(path_type=Path, file_okay=False, exists=True),
    help="Recorded runs (Parquet), as `cosim sensor dataset` writes them.",
)
@click.option(
    "--estimators",
    metavar="A,B,...",
    help="Estimators by name; all that are shipped by default.",
)
@click.option(
    "--conditions",
    metavar="A,B",
    help="Measurement conditions, ideal or production; both by default.",
)
@click.option(
    "--out",
    metavar="FILE",
    required=True,
    type=click.Path(path_type=Path, dir_okay=False),
    help="Where the figures go (JSON); those that it has of the same runs and estimators are kept.",
)
@click.option(
    "--jobs",
    metavar="N",
    type=click.IntRange(1),
    help="Evaluate up to N runs at the same time, as many as there are cores by default.",
)
def evaluate(
    data: Path, estimators: str | None, conditions: str | None, out: Path, jobs: int | None
) -> None:
    """Compare estimators with the truth of recorded runs, under every measurement condition.

    The same samples count for all estimators; the first second of a run counts for none.
    """
    one_thread()
    with failures_as_exit_codes():
        from cosim.evaluation.command import run

        run(data, _names(estimators), _names(conditions), out, jobs or cores())


@sensor.command()
@click.option(
    "--out",
    metavar="DIR",
    required=True,
    type=click.Path(path_type=Path, file_okay=False),
    help="Where the filters go, <name>_<condition>.npz.",
)
def kalman(out: Path) -> None:
    """Design the Kalman filters on the vehicle FMU, linearised at a grid of speeds."""
    one_thread()
    with failures_as_exit_codes():
        from cosim.kalman.design import write_all

        write_all(out, lambda path: click.echo(path, err=True))


def _names(text: str | None) -> list[str] | None:
    """Return the names of a list with commas; None if nothing is named."""
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]


@sensor.command()
@click.argument("recipe", type=click.Path(path_type=Path))
@click.option(
    "--data",
    metavar="DIR",
    required=True,
    multiple=True,
    type=_DIRECTORY,
    help="Runs (Parquet); may be given several times.",
)
@click.option("--out", metavar="DIR", required=True, type=_DIRECTORY, help="Where results go.")
@click.option("--resume", is_flag=True, help="Go on from the checkpoint in --out, if there is one.")
@click.option("--seed", metavar="N", type=click.IntRange(0), help="In place of the recipe's seed.")
def train(recipe: Path, data: tuple[Path, ...], out: Path, resume: bool, seed: int | None) -> None:
    """Train what RECIPE, a YAML file, describes: checkpoint, training.json and network in DIR.

    A training that was stopped goes on with --resume and ends in the same weights.
    """
    threads_that_sleep()
    with failures_as_exit_codes():
        from sensor import families

        families.train(families.Training(recipe, data, out, resume, seed))


@sensor.command()
@click.argument("recipe", type=click.Path(path_type=Path))
@click.option("--data", metavar="DIR", required=True, type=_DIRECTORY, help="Runs (Parquet).")
@click.option(
    "--out",
    metavar="DIR",
    required=True,
    type=_DIRECTORY,
    help="Where the studies and search.json go; a search that is there goes on.",
)
@click.option(
    "--jobs",
    metavar="N",
    default=1,
    show_default=True,
    type=click.IntRange(1),
    help="Processes; the same command may also be started several times.",
)
@click.option(
    "--samples",
    metavar="N",
    default=1000,
    show_default=True,
    type=click.IntRange(1),
    help="Samples over which the networks' durations are measured at the end.",
)
@click.option("--summary", is_flag=True, help="No trials: only the results of those there are.")
def search(recipe: Path, data: Path, out: Path, jobs: int, samples: int, summary: bool) -> None:
    """Search the best shape of the network for each window size, as RECIPE says."""
    threads_that_sleep()
    with failures_as_exit_codes():
        from sensor.search import command

        command.run(recipe, data, out, command.Budget(0 if summary else jobs, samples))


def _check_place(source: Path, out: Path) -> None:
    """Raise `InputError` where no network can be written, or its source would be lost."""
    from cosim.errors import InputError

    if out.suffix != ".onnx":
        raise InputError(f"'{out}': the name of a network ends in .onnx")
    if not out.parent.is_dir():
        raise InputError(f"'{out}': there is no folder '{out.parent}'")
    if out.exists() and source.exists() and out.samefile(source):
        raise InputError(f"'{out}' is the file that is read; give another name")


@sensor.command()
@click.argument("source", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--out",
    metavar="FILE.onnx",
    required=True,
    type=click.Path(path_type=Path, dir_okay=False),
)
@click.option(
    "--streaming",
    is_flag=True,
    help="SOURCE is a windowed ONNX network: write its streaming form, for other tools.",
)
def export(source: Path, out: Path, streaming: bool) -> None:
    """Write the best network so far of a training, SOURCE = checkpoint.pt, as ONNX.

    The file is the windowed network, or the one with carried state. `cosim` itself makes the
    streaming form of a windowed network when it opens the file.
    """
    with failures_as_exit_codes():
        _check_place(source, out)
        if streaming:
            from sensor.streaming.export import export_streaming

            export_streaming(source, out)
        else:
            from sensor import families

            families.export(source, out)
