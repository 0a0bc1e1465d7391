"""The recipe of a training: which runs, which network, which optimiser settings. One YAML file,
read strictly.
"""

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from sensor.errors import SensorError

RECIPES = Path(__file__).parent / "recipes"


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class NetworkRecipe(_Part):
    """Shape of the network; the defaults are the paper's.

    `channels` says what stands in the places of the four wheel speeds: the speeds (`raw`) or their
    residuals (`residual`, see `sensor.features`).
    """

    channels: Literal["raw", "residual"] = "raw"
    window: int = Field(default=19, ge=1)
    units: int = Field(default=167, ge=1)
    hidden: int = Field(default=256, ge=1)
    dropout: float = Field(default=0.5, ge=0.0, lt=1.0)


class TrainingRecipe(_Part):
    """How the network is trained: Adam on the mean square of the standardised error.

    `windows_per_epoch` and `validation_windows` None mean all. `schedule` is the learning rate over
    the epochs: constant, `cosine` to zero, or `step` (a tenth after two thirds of the epochs).
    """

    epochs: int = Field(default=30, ge=1)
    learning_rate: float = Field(default=1e-3, gt=0.0)
    schedule: Literal["constant", "cosine", "step"] = "constant"
    batch_size: int = Field(default=512, ge=1)
    windows_per_epoch: int | None = Field(default=None, ge=1)
    validation_windows: int | None = Field(default=None, ge=1)
    precision: Literal["fp32", "bf16"] = "fp32"
    threads: int = Field(default=1, ge=1)


class FirRecipe(_Part):
    """The linear filter beside the network; of the ridges (relative to unit variance) the best in
    validation is kept.
    """

    window: int = Field(default=19, ge=1)
    channels: Literal["raw", "residual"] = "raw"
    ridges: tuple[float, ...] = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)


class RunSelection(_Part):
    """File stems of the runs as glob patterns, by part; each must match at least one file."""

    training: tuple[str, ...] = Field(min_length=1)
    validation: tuple[str, ...] = Field(min_length=1)


class Recipe(_Part):
    """A whole recipe of a windowed network.

    `seed` decides the initial weights, the windows of each epoch, the dropout and the measurement
    errors; `condition` what the network is shown, the ideal channels or what production parts
    measure.
    """

    name: str
    family: Literal["bilstm"] = "bilstm"
    condition: Literal["ideal", "production"] = "ideal"
    seed: int = Field(default=1, ge=0)
    network: NetworkRecipe = NetworkRecipe()
    training: TrainingRecipe = TrainingRecipe()
    fir: FirRecipe = FirRecipe()
    runs: RunSelection


def read_recipe(path: str | Path) -> Recipe:
    """Read a recipe; raises SensorError with one sentence for each entry that does not fit."""
    try:
        content = YAML(typ="safe").load(Path(path))
        return Recipe.model_validate(content)
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
