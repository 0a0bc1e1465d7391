"""Which function trains and which writes the network, by the `family` that a recipe names."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Final, TypeVar

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from sensor.errors import SensorError

_T = TypeVar("_T")


@dataclass(frozen=True)
class Training:
    """What a training is told: recipe file, directories of the runs, directory of the results,
    whether to go on from the checkpoint there, and a seed in place of the recipe's.
    """

    recipe: Path
    data: tuple[Path, ...]
    out: Path
    resume: bool = False
    seed: int | None = None


def _bilstm(training: Training) -> None:
    from sensor.training import train

    train(
        _single(training),
        training.recipe,
        training.out,
        resume=training.resume,
        seed=training.seed,
    )


def _single(training: Training) -> Path:
    if len(training.data) != 1:
        raise SensorError(f"{training.recipe}: this family trains on one --data, not several.")
    return training.data[0]


def _carried(training: Training) -> None:
    from sensor.carried.recipe import read_carried
    from sensor.carried.training import train
    from sensor.progress import epochs

    recipe = read_carried(training.recipe)
    if training.seed is not None:
        recipe = recipe.model_copy(update={"seed": training.seed})
    with epochs(recipe.training.epochs) as tell:
        train(recipe, training.data, training.out, training.resume, tell)


def _fir(training: Training) -> None:
    from sensor.baselines.fit import train

    if training.resume or training.seed is not None:
        raise SensorError("the linear filters are fitted at once: nothing to resume, no seed.")
    data, recipe = _single(training), training.recipe.name
    command = f"cosim sensor train {recipe} --data {data.name} --out {training.out.name}"
    train(data, training.recipe, training.out, command)


def _export_bilstm(checkpoint: Path, path: Path) -> None:
    from sensor.training import export_checkpoint

    export_checkpoint(checkpoint, path)


def _export_carried(checkpoint: Path, path: Path) -> None:
    from sensor.carried.training import export_checkpoint

    export_checkpoint(checkpoint, path)


TRAIN: Final[Mapping[str, Callable[[Training], None]]] = {
    "bilstm": _bilstm,
    "carried": _carried,
    "fir": _fir,
}
EXPORT: Final[Mapping[str, Callable[[Path, Path], None]]] = {
    "bilstm": _export_bilstm,
    "carried": _export_carried,
}


def train(training: Training) -> None:
    """Train by a recipe, whatever its family; raises SensorError if recipe or data do not fit."""
    _chosen(TRAIN, family_of(training.recipe), training.recipe)(training)


def export(checkpoint: Path, path: Path) -> None:
    """Write the network of a checkpoint as ONNX; raises SensorError if it is none."""
    from sensor.checkpoint import read

    recipe = json.loads(read(checkpoint)["recipe"])
    _chosen(EXPORT, recipe.get("family"), checkpoint)(checkpoint, path)


def family_of(recipe: Path) -> object:
    """Return the entry `family` of a recipe; raises SensorError if it is not to be read."""
    try:
        content = YAML(typ="safe").load(recipe)
    except OSError as error:
        raise SensorError(f"{recipe}: it cannot be read: {error.strerror}.") from error
    except YAMLError as error:
        raise SensorError(f"{recipe}: it is no valid YAML: {error}") from error
    return content.get("family") if isinstance(content, dict) else None


def _chosen(table: Mapping[str, _T], family: object, source: Path) -> _T:
    """Return the entry of a family; raises SensorError with the nearest one if there is none."""
    if isinstance(family, str) and family in table:
        return table[family]
    known = ", ".join(sorted(table))
    near = get_close_matches(str(family), table, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else "."
    raise SensorError(f"{source}: family is {family!r}, where one of {known} belongs{hint}")
