"""The recipe of a training of the network with carried state: one YAML file, read strictly."""

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from sensor.conditions import Condition
from sensor.errors import SensorError


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
    """

    epochs: int = Field(default=40, ge=1)
    learning_rate: float = Field(default=3e-3, gt=0.0)
    streams: int = Field(default=48, ge=1)
    chunk: int = Field(default=100, ge=2)
    warm_up: int = Field(default=20, ge=0)
    weight_floor: float | None = Field(default=0.004, gt=0.0)
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
    try:
        return CarriedRecipe.model_validate(YAML(typ="safe").load(Path(path)))
    except OSError as error:
        raise SensorError(f"{path}: it cannot be read: {error.strerror}.") from error
    except YAMLError as error:
        raise SensorError(f"{path}: it is no valid YAML: {error}") from error
    except ValidationError as error:
        lines = [
            f"{path}: {'.'.join(map(str, problem['loc'])) or 'the file'}: {problem['msg']}"
            f" (got {problem['input']!r})."
            for problem in error.errors()
        ]
        raise SensorError("\n".join(lines)) from error
