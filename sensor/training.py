"""The training loop: each epoch sees a seeded random part of the windows, and the best epoch in
validation is kept.

Every random draw depends on (seed, epoch) alone, so a training resumed from its checkpoint ends in
the same weights as one that was never interrupted.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch

from sensor import checkpoint
from sensor.checkpoint import Progression
from sensor.dataset import Run, WindowSet
from sensor.errors import SensorError
from sensor.network import BiLstmNetwork, NetworkConfig
from sensor.progress import epochs
from sensor.provenance import versions
from sensor.recipe import Recipe, TrainingRecipe, read_recipe
from sensor.training_data import as_seen, read_parts, window_sets

_VALIDATION_BATCH = 2048


def train(
    data: Path, recipe_path: Path, out: Path, *, resume: bool = False, seed: int | None = None
) -> BiLstmNetwork:
    """Train by the recipe on the runs in `data`; write checkpoint, `training.json` and the ONNX
    network to `out`. `seed` takes the place of the recipe's.

    Returns the network of the best epoch. Raises SensorError if recipe or data do not fit.
    """
    from sensor.export import export_windowed

    recipe = read_recipe(recipe_path)
    if seed is not None:
        recipe = recipe.model_copy(update={"seed": seed})
    training, validation = read_parts(data, recipe.runs)
    out.mkdir(parents=True, exist_ok=True)
    network, record = fit(recipe, training, validation, out, resume=resume)
    export_windowed(network, out / f"{recipe.name}.onnx", training=record)
    return network


def fit(
    recipe: Recipe, training: Sequence[Run], validation: Sequence[Run], out: Path, *, resume: bool
) -> tuple[BiLstmNetwork, dict[str, Any]]:
    """Train on runs already read; return the network of the best epoch and the training record.

    With `resume` the training goes on from the checkpoint in `out`, if there is one.
    """
    trainer = Trainer.of(recipe, *window_sets(recipe, training, validation))
    network = trainer.network
    if resume and (out / checkpoint.NAME).is_file():
        checkpoint.load(trainer, out / checkpoint.NAME)
    description = _describe(recipe, training, validation)
    total = recipe.training.epochs
    with epochs(total) as tell:
        for epoch in range(len(trainer.reached.epochs), total):
            tell(epoch, total, trainer.summary())
            if epoch and recipe.condition != "ideal":  # offsets and gains: other ones every epoch
                seen = as_seen(recipe, training, draw=epoch)
                normalisation = trainer.training.normalisation
                trainer.training = WindowSet(seen, recipe.network.window, normalisation)
            trainer.run_epoch(epoch)
            checkpoint.save(trainer, out / checkpoint.NAME)
            checkpoint.write_record(description | trainer.record(), out)
        tell(total, total, trainer.summary())
    network.load_state_dict(trainer.reached.best_weights)
    return network.eval(), description | trainer.record()


class Trainer:
    """One training in progress: network, optimiser and what has been reached."""

    @classmethod
    def of(cls, recipe: Recipe, training: WindowSet, validation: WindowSet) -> "Trainer":
        """Begin a training with the initial weights that the recipe's seed gives."""
        torch.set_num_threads(recipe.training.threads)
        torch.manual_seed(recipe.seed)
        network = network_of(recipe)
        for name, values in asdict(training.normalisation).items():
            getattr(network, name).copy_(torch.from_numpy(values))
        return cls(recipe, network, training, validation)

    def __init__(
        self, recipe: Recipe, network: BiLstmNetwork, training: WindowSet, validation: WindowSet
    ) -> None:
        self.recipe, self.network = recipe, network
        self.training, self.validation = training, validation
        self.optimiser = torch.optim.Adam(network.parameters(), lr=recipe.training.learning_rate)
        self.reached = Progression()

    def run_epoch(self, epoch: int) -> None:
        """Train one epoch, validate, keep the weights if they are the best so far."""
        start = time.perf_counter()
        settings = self.recipe.training
        rate = learning_rate(settings, epoch)
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        torch.manual_seed(
            int(np.random.SeedSequence([self.recipe.seed, epoch]).generate_state(1)[0])
        )
        windows = self.training.subset(settings.windows_per_epoch, (self.recipe.seed, epoch))
        training_rmse = self._train(windows)
        validation_rmse = self.validate()
        if not math.isfinite(validation_rmse):
            raise SensorError(
                f"the training diverged in epoch {epoch + 1}; lower the learning rate."
            )
        reached = self.reached
        reached.epochs.append(
            {
                "epoch": epoch + 1,
                "training_rmse": training_rmse,
                "validation_rmse": validation_rmse,
                "learning_rate": rate,
                "seconds": round(time.perf_counter() - start, 3),
            }
        )
        if validation_rmse < reached.best:
            reached.best, reached.best_epoch = validation_rmse, epoch + 1
            state = self.network.state_dict()
            reached.best_weights = {name: value.clone() for name, value in state.items()}

    def _train(self, windows: npt.NDArray[np.int64]) -> float:
        """One pass over the windows; return the RMSE [m/s] met on the way, dropout active."""
        self.network.train()
        total = torch.zeros(self.network.config.outputs)
        for measured, truth in self.training.batches(windows, self.recipe.training.batch_size):
            with self._precision():
                estimate = self.network.standardised(torch.from_numpy(measured))
            square = (estimate.float() - torch.from_numpy(truth)).square()
            self.optimiser.zero_grad()
            square.mean().backward()  # type: ignore[no-untyped-call]
            self.optimiser.step()
            total += square.detach().sum(dim=0)
        return self._pooled_rmse(total, len(windows))

    @torch.no_grad()
    def validate(self) -> float:
        """RMSE [m/s] on the validation windows, the same at every epoch, all wheels pooled."""
        self.network.eval()
        windows = self.validation.subset(
            self.recipe.training.validation_windows, (self.recipe.seed,)
        )
        total = torch.zeros(self.network.config.outputs)
        for measured, truth in self.validation.batches(windows, _VALIDATION_BATCH):
            estimate = self.network.standardised(torch.from_numpy(measured))
            total += (estimate - torch.from_numpy(truth)).square().sum(dim=0)
        return self._pooled_rmse(total, len(windows))

    def _pooled_rmse(self, squares: torch.Tensor, count: int) -> float:
        """From sums of squared standardised errors (4,) over `count` windows to m/s."""
        return float((squares * self.network.output_std.square()).mean().div(count).sqrt())

    def _precision(self) -> torch.autocast:
        bf16 = self.recipe.training.precision == "bf16"
        return torch.autocast("cpu", torch.bfloat16, enabled=bf16)

    def summary(self) -> str:
        """One short line for the progress display."""
        if not self.reached.epochs:
            return "first epoch"
        last = self.reached.epochs[-1]
        return (
            f"epoch {last['epoch']:.0f}: validation {1e3 * last['validation_rmse']:.2f} mm/s, "
            f"best {1e3 * self.reached.best:.2f} (epoch {self.reached.best_epoch})"
        )

    def record(self) -> dict[str, Any]:
        """What `training.json` says of the course of the training."""
        return {
            "best_epoch": self.reached.best_epoch,
            "best_validation_rmse": self.reached.best,
            "epochs": self.reached.epochs,
        }


def network_of(recipe: Recipe) -> BiLstmNetwork:
    """Return a network of the recipe's shape with weights drawn."""
    shape = recipe.network
    return BiLstmNetwork(
        NetworkConfig(
            shape.window,
            units=shape.units,
            hidden=shape.hidden,
            dropout=shape.dropout,
            residual=shape.channels == "residual",
        )
    )


def export_checkpoint(path: Path, out: Path) -> None:
    """Write the best network so far of a training as ONNX to `out`; raises SensorError if there is
    none yet.
    """
    from sensor.export import export_windowed

    network = network_of(Recipe.model_validate_json(checkpoint.read(path)["recipe"]))
    network.load_state_dict(checkpoint.best_weights(path))
    export_windowed(network.eval(), out, training=checkpoint.record_beside(path))


def learning_rate(settings: TrainingRecipe, epoch: int) -> float:
    """Learning rate of an epoch (counted from 0) by the recipe's schedule."""
    if settings.schedule == "cosine":
        return settings.learning_rate * 0.5 * (1.0 + math.cos(math.pi * epoch / settings.epochs))
    if settings.schedule == "step" and 3 * epoch >= 2 * settings.epochs:
        return 0.1 * settings.learning_rate
    return settings.learning_rate


def _describe(recipe: Recipe, training: Sequence[Run], validation: Sequence[Run]) -> dict[str, Any]:
    """What `training.json` says of recipe, versions and data."""
    data = {
        part: {run.name: len(run.channels) for run in runs}
        for part, runs in (("training", training), ("validation", validation))
    }
    return {"recipe": recipe.model_dump(mode="json"), "versions": versions(), "samples": data}
