"""The recipe of a training: which runs, which network, which optimiser settings. One YAML file,
read strictly.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from sensor.errors import SensorError

RECIPES = Path(__file__).parent / "recipes"


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


_P = TypeVar("_P", bound=BaseModel)


class NetworkRecipe(_Part):
    """Shape of the network; the defaults are the paper's.

    `channels` says what stands in the places of the four wheel speeds: the speeds (`raw`) or their
    residuals (`residual`, see `sensor.features`).
    """

    channels: Literal["raw", "residual"] = "raw"
    window: int = Field(default=19, ge=2)
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


class RunSelection(_Part):
    """File stems of the runs as glob patterns, by part; each must match at least one file.

    Validation runs are named, or are every `hold_out`-th of the training's, sorted by name.
    """

    training: tuple[str, ...] = Field(min_length=1)
    validation: tuple[str, ...] = ()
    hold_out: int | None = Field(default=None, ge=2)

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if bool(self.validation) == (self.hold_out is not None):
            raise ValueError("validation runs are either named (validation) or held out (hold_out)")
        return self


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
    runs: RunSelection


class Span(_Part):
    """Whole numbers from `least` to `most`, both included."""

    least: int = Field(default=1, ge=1)
    most: int = Field(default=512, ge=1)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.least > self.most:
            raise ValueError(f"least is {self.least}, above most, {self.most}")
        return self


class EarlyStop(_Part):
    """A trial stops after an epoch, the `after`-th or a later one, in which its validation RMSE is
    `behind` (relative) above the median that finished trials of its window had there.
    """

    after: int = Field(ge=1)
    behind: float = Field(default=0.1, ge=0.0)


class SearchRecipe(_Part):
    """A search over the units of LSTM and dense layer, for each window size by itself.

    Each window gets `trials` trainings by `training`, the first `startup` spread evenly, the others
    where the Gaussian process expects most. `seed` decides all random draws of the sampler and the
    trainings.
    """

    name: str
    condition: Literal["ideal", "production"] = "ideal"
    seed: int = Field(default=1, ge=0)
    channels: Literal["raw", "residual"] = "raw"
    windows: tuple[int, ...] = Field(min_length=1)
    units: Span = Span()
    hidden: Span = Span()
    dropout: float = Field(default=0.5, ge=0.0, lt=1.0)
    trials: int = Field(ge=1)
    startup: int = Field(ge=2)
    stop: EarlyStop | None = None
    training: TrainingRecipe
    runs: RunSelection

    def continues(self, begun: Mapping[str, Any]) -> bool:
        """Tell whether a search that was `begun` with such a recipe may go on with this one, which
        may have other windows and more trials.
        """
        free = {"windows": self.windows, "trials": self.trials}
        return type(self).model_validate({**begun, **free}) == self

    def trial(self, window: int, units: int, hidden: int) -> Recipe:
        """Return the recipe of one trial."""
        network = NetworkRecipe(
            channels=self.channels,
            window=window,
            units=units,
            hidden=hidden,
            dropout=self.dropout,
        )
        return Recipe(
            name=f"{self.name}_w{window}",
            condition=self.condition,
            seed=self.seed,
            network=network,
            training=self.training,
            runs=self.runs,
        )


def read_recipe(path: str | Path) -> Recipe:
    """Read a training's recipe; raises SensorError with one sentence for each entry that does not
    fit.
    """
    return read_strictly(path, Recipe)


def read_search_recipe(path: str | Path) -> SearchRecipe:
    """Read a search's recipe; raises as `read_recipe` does."""
    return read_strictly(path, SearchRecipe)


def read_strictly(path: str | Path, kind: type[_P]) -> _P:
    """Read a recipe of any kind; raises SensorError with one sentence for each entry that does not
    fit.
    """
    try:
        content = YAML(typ="safe").load(Path(path))
        return kind.model_validate(content)
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
