"""Obstacles on the road of a scenario."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.scenario.model import Model, with_unit

Side = Literal["left", "right", "both"]
_Place = Annotated[
    float,
    Field(ge=3, description="where it begins, from the start", json_schema_extra=with_unit("m")),
]
_Length = Annotated[
    float, Field(gt=0, description="length along the road", json_schema_extra=with_unit("m"))
]


class BumpRow(Model):
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
    from_m: float = Field(
        default=15.0, ge=3, description="first bump", json_schema_extra=with_unit("m")
    )
    to_m: float | None = Field(
        default=None,
        gt=0,
        description="no bump beyond; the road's end if not given",
        json_schema_extra=with_unit("m"),
    )

    @model_validator(mode="after")
    def _bumps_do_not_overlap(self) -> BumpRow:
        if self.spacing_m < self.length_m:
            raise PydanticCustomError(
                "overlap",
                "spacing_m ({spacing} m) must not be less than length_m ({length} m)",
                {"spacing": self.spacing_m, "length": self.length_m},
            )
        return self


class SpeedHump(Model):
    """One cosine bump, across the whole road or one half of it; below 0 a dip."""

    kind: Literal["hump"]
    at_m: _Place
    height_m: float = Field(
        ge=-0.3, le=0.3, description="height, negative for a dip", json_schema_extra=with_unit("m")
    )
    length_m: _Length
    side: Side = Field(default="both", description="half of the road, seen in driving direction")


class Hole(Model):
    """A hole with a flat bottom and sloped edges; of negative depth a raised plate."""

    kind: Literal["pothole"]
    at_m: _Place
    depth_m: float = Field(
        ge=-0.3,
        le=0.3,
        description="depth, negative for a raised plate",
        json_schema_extra=with_unit("m"),
    )
    length_m: _Length
    width_m: float = Field(
        gt=0, description="width across the road", json_schema_extra=with_unit("m")
    )
    side: Side = Field(default="both", description="wheels that meet it")
    edge_m: float = Field(
        default=0.1,
        gt=0,
        description="width of the sloped edge, within length and width",
        json_schema_extra=with_unit("m"),
    )
    offset_m: float = Field(
        default=0.81,
        ge=0,
        description="its middle, to the side of the reference line; a wheel's path by default",
        json_schema_extra=with_unit("m"),
    )


Obstacle = Annotated[BumpRow | SpeedHump | Hole, Field(discriminator="kind")]
