"""Training of the network with carried state: truncated backpropagation through time.

Every random draw depends on (seed, epoch) alone, so a training resumed from its checkpoint ends in
the same weights as one that was never interrupted.
"""

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import torch

from sensor import checkpoint
from sensor.carried.features import features
from sensor.carried.mirror import Mirror
from sensor.carried.network import SCALE, CarriedConfig, CarriedNetwork, State
from sensor.carried.recipe import CarriedRecipe
from sensor.carried.streams import Chunk, Sequence4, Streams
from sensor.checkpoint import Progression
from sensor.dataset import Run, read_runs, split
from sensor.errors import SensorError
from sensor.provenance import versions

DEVIATION_SHARE = (
    0.1  # of the deviation's loss beside the velocity's; it pulls at its own layer only
)
COVERAGE, SIGMAS = 0.90, 1.645  # of a normal distribution
LARGEST_GRADIENT = 1.0
LEAST_DEVIATION = 1e-6  # m/s


def train(
    recipe: CarriedRecipe,
    data: Path | Sequence[Path],
    out: Path,
    resume: bool,
    progress: Callable[[int, int, str], None] = lambda done, total, text: None,
) -> CarriedNetwork:
    """Train by the recipe on the runs in `data`; write checkpoint, `training.json` and the ONNX
    network to `out`; `progress` is told epochs done, of how many, and one line.

    Raises SensorError if recipe, checkpoint and data do not fit.
    """
    from sensor.carried.graph import export_carried

    directories = [data] if isinstance(data, Path) else data
    runs = [run for directory in directories for run in read_runs(directory, recipe.runs)]
    out.mkdir(parents=True, exist_ok=True)
    training, validation = split(runs, recipe.hold_out)
    trainer = Trainer(recipe, training, validation)
    if resume and (out / checkpoint.NAME).is_file():
        checkpoint.load(trainer, out / checkpoint.NAME)
    total = recipe.training.epochs
    for epoch in range(len(trainer.reached.epochs), total):
        trainer.run_epoch(epoch)
        checkpoint.save(trainer, out / checkpoint.NAME)
        checkpoint.write_record(trainer.record(), out)
        progress(epoch + 1, total, trainer.summary())
    network = trainer.finished()
    checkpoint.write_record(trainer.record(), out)
    export_carried(network, out / f"{recipe.name}.onnx", trainer.record())
    return network


def export_checkpoint(path: Path, out: Path) -> None:
    """Write the best network so far of a training as ONNX to `out`; raises SensorError if there is
    none yet.
    """
    from sensor.carried.graph import export_carried

    shape = CarriedRecipe.model_validate_json(checkpoint.read(path)["recipe"]).network
    network = CarriedNetwork(CarriedConfig(shape.front, shape.units, shape.hidden))
    network.load_state_dict(checkpoint.best_weights(path))
    export_carried(network.eval(), out, checkpoint.record_beside(path))


class Trainer:
    """One training in progress."""

    def __init__(
        self, recipe: CarriedRecipe, training: Sequence[Run], validation: Sequence[Run]
    ) -> None:
        torch.set_num_threads(recipe.training.threads)
        torch.manual_seed(recipe.seed)
        self.recipe, self.runs, self.held = recipe, training, validation
        self.network = self.build()
        self.optimiser = torch.optim.Adam(
            self.network.parameters(), lr=recipe.training.learning_rate
        )
        self.reached = Progression()
        self._mirror = Mirror(self.network.config.features) if recipe.training.mirror else None
        sequences = self._prepared(training, 0)
        self._normalise(sequences)
        # Exact channels are the same in every epoch
        self._lasting = sequences if recipe.condition == "ideal" else None
        self._validation = self._prepared(validation, -1)

    def build(self) -> CarriedNetwork:
        """Return a network of the recipe's shape, its weights drawn."""
        shape = self.recipe.network
        return CarriedNetwork(CarriedConfig(shape.front, shape.units, shape.hidden))

    def features(self, run: Run, measured: npt.NDArray[np.float64]) -> npt.NDArray[np.float32]:
        """Return what the network reads of a run as measured (samples, 14)."""
        return features(measured, run.commands)

    def _prepared(self, runs: Sequence[Run], epoch: int) -> list[Sequence4]:
        """Features of the runs as measured in this epoch."""
        floor = self.recipe.training.weight_floor
        prepared = []
        for i, run in enumerate(runs):
            seed = int(
                np.random.SeedSequence([self.recipe.seed, epoch + 1, i]).generate_state(1)[0]
            )
            measured = run.measured(self.recipe.condition, seed)
            square = float(np.mean(np.square(run.truth)))
            weight = 1.0 / math.sqrt(square + floor**2) if floor else 1.0 / SCALE
            prepared.append(Sequence4(self.features(run, measured), run.truth, weight))
        return prepared

    def _normalise(self, sequences: Sequence[Sequence4]) -> None:
        """Mean and deviation of the features, without the level, over all training samples."""
        parts = [sequence.features[:, :-1] for sequence in sequences]
        count = sum(len(part) for part in parts)
        mean = sum(part.sum(axis=0, dtype=np.float64) for part in parts) / count
        square = sum(np.square(part - mean).sum(axis=0, dtype=np.float64) for part in parts)
        std = np.sqrt(square / count)
        std[std < 1e-9] = 1.0
        self.network.mean.copy_(torch.from_numpy(np.asarray(mean, dtype=np.float32)))
        self.network.std.copy_(torch.from_numpy(np.asarray(std, dtype=np.float32)))

    def run_epoch(self, epoch: int) -> None:
        """Train one epoch, validate, keep the weights if they are the best so far."""
        begin = time.perf_counter()
        settings = self.recipe.training
        random = np.random.default_rng([self.recipe.seed, epoch])
        streams = Streams(settings.streams, settings.chunk, settings.warm_up)
        chunks = list(streams.chunks(self._played(epoch, random), random))
        squares = 0.0
        state: State | None = None
        self.network.train()
        self.network.coarse = epoch < settings.coarse_epochs
        for number, chunk in enumerate(chunks):
            self._set_rate((epoch + number / len(chunks)) / settings.epochs)
            error, state = self._step(chunk, state)
            squares += error
        self._judge(epoch, math.sqrt(squares / len(chunks)), time.perf_counter() - begin)

    def _played(self, epoch: int, random: np.random.Generator) -> list[Sequence4]:
        """Every run as measured in this epoch, or, as likely, its mirror image."""
        runs = self._lasting or self._prepared(self.runs, epoch)
        if self._mirror is None:
            return runs
        turned = random.integers(2, size=len(runs))
        return [self._mirror.image(run) if t else run for run, t in zip(runs, turned, strict=True)]

    def _step(self, chunk: Chunk, state: State | None) -> tuple[float, State]:
        """One step of the optimiser; return the mean weighted square error and the next state."""
        starts = torch.from_numpy(chunk.starts)[None, :, None]
        if state is not None:
            state = (state[0] * starts, state[1] * starts)
        velocity, deviation, after = self.network(torch.from_numpy(chunk.features), state)
        weight = torch.from_numpy(chunk.weight)
        error = velocity - torch.from_numpy(chunk.truth)
        square = (error * weight).square().mean()
        deviation = deviation.clamp_min(LEAST_DEVIATION)  # filled-up places have level 0
        likely = torch.log(deviation) + 0.5 * (error.detach() / deviation).square()
        loss = square + DEVIATION_SHARE * (likely * (weight > 0)).mean()
        self.optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), LARGEST_GRADIENT)
        self.optimiser.step()
        return float(square.detach()), (after[0].detach(), after[1].detach())

    def _set_rate(self, progress: float) -> None:
        rate = self.recipe.training.learning_rate * 0.5 * (1.0 + math.cos(math.pi * progress))
        for group in self.optimiser.param_groups:
            group["lr"] = rate * min(1.0, 50.0 * progress * self.recipe.training.epochs / 10 + 0.05)

    def _judge(self, epoch: int, training: float, seconds: float) -> None:
        """Record the epoch and keep its weights if its error in validation is the least."""
        validation, calibration = self.validate()
        if not math.isfinite(validation):
            raise SensorError(
                f"the training diverged in epoch {epoch + 1}; lower the learning rate."
            )
        reached = self.reached
        reached.epochs.append(
            {
                "epoch": epoch + 1,
                "training_error": round(training, 5),
                "validation_error": round(validation, 5),
                "seconds": round(seconds, 1),
            }
        )
        if validation < reached.best:
            reached.best, reached.best_epoch = validation, epoch + 1
            weights = self.network.state_dict()
            reached.best_weights = {name: value.clone() for name, value in weights.items()}
            reached.best_weights["calibration"] = calibration

    @torch.no_grad()
    def validate(self) -> tuple[float, torch.Tensor]:
        """Return the error on the runs held out (rms over runs of their weighted rmse, a ratio),
        and the factors (4,) with which 90 % of their samples lie within 1.645 predicted deviations.
        """
        self.network.eval()
        self.network.coarse = False
        squares, ratios = [], []
        part = slice(self.recipe.training.warm_up, None)
        for sequence in self._validation:
            rows = torch.from_numpy(sequence.features)[:, None]
            velocity, deviation, _ = self.network(rows)
            error = (velocity[:, 0].numpy() - sequence.truth)[part]
            squares.append(float(np.mean(np.square(error))) * sequence.weight**2)
            ratios.append(np.abs(error) / deviation[part, 0].numpy())
        factor = np.quantile(np.concatenate(ratios), COVERAGE, axis=0) / SIGMAS
        return math.sqrt(float(np.mean(squares))), torch.from_numpy(factor.astype(np.float32))

    def finished(self) -> CarriedNetwork:
        """Return the network of the best epoch, its deviation calibrated on the runs held out."""
        self.network.load_state_dict(self.reached.best_weights)
        return self.network.eval()

    def summary(self) -> str:
        """One line on the last epoch."""
        last, reached = self.reached.epochs[-1], self.reached
        return (
            f"training {100 * last['training_error']:.2f} %, "
            f"validation {100 * last['validation_error']:.2f} %, "
            f"best {100 * reached.best:.2f} % (epoch {reached.best_epoch})"
        )

    def record(self) -> dict[str, Any]:
        """What `training.json` and the network's metadata say of the training."""
        return {
            "recipe": self.recipe.model_dump(mode="json"),
            "versions": versions(),
            "samples": {
                "training": sum(len(run.truth) for run in self.runs),
                "validation": sum(len(run.truth) for run in self.held),
                "validation_runs": [run.name for run in self.held],
            },
            "best_epoch": self.reached.best_epoch,
            "best_validation_error": self.reached.best,
            "epochs": self.reached.epochs,
        }
