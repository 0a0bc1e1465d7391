"""The surface of a road in a scenario."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.scenario.model import Model, with_unit


class SmoothSurface(Model):
    """A surface without unevenness, as on the example roads of vehicle simulators."""

    kind: Literal["smooth"] = "smooth"


class IsoSurface(Model):
    """A random surface with the spectrum of an ISO 8608 class."""

    kind: Literal["iso8608"]
    road_class: Literal["A", "B", "C", "D"] = Field(
        alias="class", description="ISO 8608 class, A the smoothest"
    )
    seed: int | None = Field(
        default=None, ge=0, description="seed of the surface; the scenario's seed if not given"
    )


class BumpSurface(Model):
    """Cosine bumps, alternately below the left and the right wheels."""

    kind: Literal["bumps"]
    height_m: float = Field(
        gt=0, le=0.3, description="height of a bump", json_schema_extra=with_unit("m")
    )
    length_m: float = Field(
        gt=0, description="length of a bump along the road", json_schema_extra=with_unit("m")
    )
    spacing_m: float = Field(
        gt=0,
        description="distance from one bump to the next on the same side",
        json_schema_extra=with_unit("m"),
    )

    @model_validator(mode="after")
    def _bumps_do_not_overlap(self) -> BumpSurface:
        if self.spacing_m < self.length_m:
            raise PydanticCustomError(
                "overlap",
                "spacing_m ({spacing} m) must not be less than length_m ({length} m)",
                {"spacing": self.spacing_m, "length": self.length_m},
            )
        return self


Surface = Annotated[SmoothSurface | IsoSurface | BumpSurface, Field(discriminator="kind")]
