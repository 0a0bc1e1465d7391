"""Checkpoints: what a training in progress writes, to go on from and to take the best network of.

A checkpoint holds the recipe as JSON, the states of network and optimiser, and what has been
reached, the weights of the best epoch among it.
"""

import json
import math
import pickle
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol

import torch
from pydantic import BaseModel

from sensor.errors import SensorError

NAME = "checkpoint.pt"
RECORD = "training.json"


@dataclass
class Progression:
    """What has been reached: a record per epoch, the least validation error, the epoch that gave
    it (counted from 1) and its weights.
    """

    epochs: list[dict[str, float]] = field(default_factory=list)
    best: float = math.inf
    best_epoch: int = 0
    best_weights: dict[str, torch.Tensor] = field(default_factory=dict)


class Training(Protocol):
    """A training in progress."""

    reached: Progression

    @property
    def recipe(self) -> Any:
        """The recipe, a pydantic model with `training.epochs`."""

    @property
    def network(self) -> torch.nn.Module:
        """The network as it is now."""

    @property
    def optimiser(self) -> torch.optim.Optimizer:
        """The optimiser with its moments."""


def save(training: Training, path: Path) -> None:
    """Write the checkpoint, whole or not at all."""
    temporary = path.with_suffix(".part")
    torch.save(
        {
            "recipe": training.recipe.model_dump_json(),
            "network": training.network.state_dict(),
            "optimiser": training.optimiser.state_dict(),
            "reached": asdict(training.reached),
        },
        temporary,
    )
    temporary.replace(path)


def load(training: Training, path: Path) -> None:
    """Go on from a checkpoint. A longer training of the same recipe may, so numbers of epochs may
    differ.

    Raises SensorError if it belongs to another recipe.
    """
    content = read(path)
    recipe = type(training.recipe).model_validate_json(content["recipe"])
    if _without_epochs(recipe) != _without_epochs(training.recipe):
        raise SensorError(f"{path}: the checkpoint was made by another recipe.")
    training.network.load_state_dict(content["network"])
    training.optimiser.load_state_dict(content["optimiser"])
    training.reached = Progression(**content["reached"])


def read(path: Path) -> dict[str, Any]:
    """Return what a checkpoint holds; raises SensorError if the file is none."""
    if not path.is_file():
        raise SensorError(f"{path}: there is no such checkpoint.")
    try:
        content = torch.load(path, weights_only=True)
        json.loads(content["recipe"])
        Progression(**content["reached"])
    except (KeyError, RuntimeError, TypeError, ValueError, pickle.UnpicklingError) as error:
        raise SensorError(
            f"{path}: it is no checkpoint of a training ({type(error).__name__})."
        ) from error
    return dict(content)


def best_weights(path: Path) -> dict[str, torch.Tensor]:
    """Return the weights of the best epoch; raises SensorError if none has been finished."""
    weights: dict[str, torch.Tensor] = read(path)["reached"]["best_weights"]
    if not weights:
        raise SensorError(f"{path}: no epoch has been finished yet.")
    return weights


def record_beside(path: Path) -> dict[str, Any]:
    """Return the record that the training keeps beside its checkpoint; without one, the recipe."""
    beside = path.with_name(RECORD)
    if beside.is_file():
        return dict(json.loads(beside.read_text(encoding="utf-8")))
    return {"recipe": json.loads(read(path)["recipe"])}


def write_record(record: dict[str, Any], out: Path) -> None:
    """Write what `record_beside` finds."""
    (out / RECORD).write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def _without_epochs(recipe: BaseModel) -> dict[str, Any]:
    return recipe.model_dump(exclude={"training": {"epochs", "coarse_epochs"}})
