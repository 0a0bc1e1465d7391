"""A limit of a scenario."""

from __future__ import annotations

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.scenario.model import Model
from cosim.scenario.surface import SurfaceName


class Limit(Model):
    """A bound on one metric; the run fails when it is crossed."""

    metric: str = Field(min_length=1, description="dotted path in metrics.json")
    min: float | None = Field(default=None, description="smallest value that passes")
    max: float | None = Field(default=None, description="largest value that passes")
    surface: SurfaceName | None = Field(
        default=None, description="only on this surface; on others the limit is left out"
    )

    @model_validator(mode="after")
    def _some_bound(self) -> Limit:
        if self.min is None and self.max is None:
            raise PydanticCustomError("no_bound", "a limit needs min, max or both")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise PydanticCustomError(
                "crossed",
                "min ({low}) must not be greater than max ({high})",
                {"low": self.min, "high": self.max},
            )
        return self
