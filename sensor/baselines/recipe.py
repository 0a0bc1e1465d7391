"""The recipe of the linear filters: one YAML file, read strictly."""

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from sensor.recipe import read_strictly

RIDGES = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)


class FirRecipe(BaseModel):
    """Which runs the filters are fitted on: file stems as glob patterns, each of which must match
    at least one; of the runs, sorted by name, every `hold_out`-th is for validation. Of the
    `ridges` (relative to unit variance) the best in validation is kept.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    family: Literal["fir"]
    name: str
    runs: tuple[str, ...] = Field(default=("*",), min_length=1)
    hold_out: int = Field(default=12, ge=2)
    ridges: tuple[float, ...] = Field(default=RIDGES, min_length=1)


def read_fir(path: str | Path) -> FirRecipe:
    """Read a recipe; raises SensorError with one sentence for each entry that does not fit."""
    return read_strictly(path, FirRecipe)
