"""The recipe of a data set: which runs, as selections of scenarios with values drawn at random."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from cosim.dataset.draw import Draws
from cosim.errors import InputError
from cosim.scenario.messages import problems_of
from cosim.scenario.model import NAME_PATTERN, Model
from cosim.scenario.source import Source, read
from cosim.scenario.surface import SurfaceName

Dampers = Literal["passive", "switching", "fixed", "skyhook"]
MOST_RUNS: Final = 1000  # of a recipe, so that two recipes never share a seed
_NEEDS = "a recipe needs name, seed and runs"


class Selection(Model):
    """Scenario files by a glob pattern relative to the recipe.

    Each file is driven `count` times on each of the surfaces (its own if none is named) with each
    kind of dampers. Every run draws the values of `draw`, and those of one of the `cases`.
    """

    scenarios: str = Field(min_length=1, description="glob pattern, relative to the recipe")
    name: str | None = Field(
        default=None, pattern=NAME_PATTERN, description="of the runs; the scenario's if not given"
    )
    surfaces: tuple[SurfaceName, ...] = Field(
        default=(), strict=False, description="one run each; the scenario's own if not given"
    )
    dampers: tuple[Dampers, ...] = Field(
        strict=False, min_length=1, description="kinds of dampers, one run each"
    )
    count: int | None = Field(
        default=None, ge=1, le=MOST_RUNS, description="runs of each combination, 1 if not given"
    )
    draw: Draws = Field(default_factory=dict, description="fields of the scenario by dotted path")
    cases: tuple[Draws, ...] = Field(
        default=(), strict=False, description="one of these sets of draws is taken for each run"
    )

    @model_validator(mode="after")
    def _each_field_once(self) -> Selection:
        taken = ["seed", *(["road.surface"] if self.surfaces else [])]
        for case in self.cases or ({},):
            paths = taken + [path for draws in (case, self.draw) for path in _paths(draws)]
            doubled = sorted({path for path in paths if paths.count(path) > 1})
            if doubled:
                raise PydanticCustomError("doubled", f"{doubled[0]} would be set twice")
        return self


def _paths(draws: Draws) -> list[str]:
    return [path for name, draw in draws.items() for path in (draw.times or (name,))]


class Recipe(Model):
    """Which runs make a data set; run i has the seed 1000 * `seed` + i for everything random in its
    scenario, and draws its values from `seed` and i alone.
    """

    name: str = Field(min_length=1, description="one line")
    seed: int = Field(ge=0, description="of all that is random; no two recipes have the same")
    draw: Draws = Field(
        default_factory=dict, description="of every run, unless its selection draws the same"
    )
    runs: tuple[Selection, ...] = Field(strict=False, min_length=1, description="the selections")


@dataclass(frozen=True)
class RecipeFile:
    """A recipe, and where its parts stand."""

    recipe: Recipe
    source: Source

    @property
    def folder(self) -> Path:
        """Where the patterns of scenarios start."""
        return self.source.folder


def load_recipe(path: Path) -> RecipeFile:
    """Read a recipe; raises `InputError` with everything wrong in it, each at its place."""
    data, source, problems = read(path, _NEEDS, "recipe")
    recipe = None
    try:
        recipe = Recipe.model_validate(data)
    except ValidationError as error:
        problems += problems_of(error, data, source, _schema())
    if problems or recipe is None:
        raise InputError(sorted(problems, key=lambda p: p.place.line if p.place else 0))
    return RecipeFile(recipe, source)


@cache
def _schema() -> dict[str, Any]:
    return Recipe.model_json_schema()
