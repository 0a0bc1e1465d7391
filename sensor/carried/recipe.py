"""The recipe of a training of the network with carried state: one YAML file, read strictly."""

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from sensor.conditions import Condition
from sensor.recipe import read_strictly


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Shape(_Part):
    """Units of the dense layer before the LSTM, of the LSTM, and of the layer behind it."""

    front: int = Field(default=64, ge=1)
    units: int = Field(default=128, ge=1)
    hidden: int = Field(default=64, ge=1)


class Schedule(_Part):
    """Adam with a cosine schedule, truncated backpropagation over `chunk` samples of `streams` runs
    side by side.

    `weight_floor` [m/s]: each run's squared error counts by 1 / (rms(truth)^2 + weight_floor^2), so
    that quiet runs count too; None weights all samples alike.
    `mirror`: in every epoch each run is played as it was or, as likely, as its mirror image.
    `coarse_epochs`: in as many epochs, the first ones, the LSTM multiplies in bfloat16: half the
    time where the processor has units for it (AMX). The last epochs belong to float32.
    """

    epochs: int = Field(default=40, ge=1)
    learning_rate: float = Field(default=3e-3, gt=0.0)
    streams: int = Field(default=48, ge=1)
    chunk: int = Field(default=100, ge=2)
    warm_up: int = Field(default=20, ge=0)
    weight_floor: float | None = Field(default=0.004, gt=0.0)
    mirror: bool = False
    coarse_epochs: int = Field(default=0, ge=0)
    threads: int = Field(default=1, ge=1)


class CarriedRecipe(_Part):
    """A whole recipe. Of the runs, sorted by name, every `hold_out`-th is for validation.

    `seed` decides the initial weights, the order of the runs and, in condition production, the
    imperfections of every run in every epoch.
    """

    family: Literal["carried"]
    name: str
    condition: Condition
    seed: int = Field(default=1, ge=0)
    network: Shape = Shape()
    training: Schedule = Schedule()
    runs: tuple[str, ...] = Field(default=("*",), min_length=1)
    hold_out: int = Field(default=12, ge=2)


def read_carried(path: str | Path) -> CarriedRecipe:
    """Read a recipe; raises SensorError with one sentence for each entry that does not fit."""
    return read_strictly(path, CarriedRecipe)
