"""The road of a scenario."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.scenario.model import Model, with_unit
from cosim.scenario.obstacles import Obstacle
from cosim.scenario.surface import SmoothSurface, Surface, SurfaceName


class Road(Model):
    """The road: one of the tracks with a surface, or an OpenCRG file."""

    track: Literal["hockenheim", "heilbronn", "rural", "straight"] | None = Field(
        default=None, description="layout of the road"
    )
    surface: Surface = Field(
        default=SmoothSurface(), description="unevenness laid over the track, by name or in full"
    )
    obstacles: tuple[Obstacle, ...] = Field(
        default=(), strict=False, description="bumps, humps and potholes laid over the surface"
    )
    friction: float | None = Field(
        default=None,
        ge=0.05,
        le=2,
        description="scale of the tyres' friction, 1 on dry asphalt, 0.4 on packed snow",
    )
    length_m: float | None = Field(
        default=None,
        ge=10,
        le=20_000,
        description="length of the straight track",
        json_schema_extra=with_unit("m"),
    )
    file: str | None = Field(
        default=None, min_length=1, description="an OpenCRG file, relative to the scenario file"
    )

    @property
    def surface_name(self) -> SurfaceName | None:
        """What a limit calls the surface; None for a road file, which has its own."""
        return self.surface.name if self.file is None else None

    @model_validator(mode="after")
    def _one_road(self) -> Road:
        given = self.model_fields_set
        if (self.track is None) == (self.file is None):
            raise PydanticCustomError("one_road", "give either track or file")
        if self.file is not None and given & {"surface", "obstacles", "length_m"}:
            raise PydanticCustomError(
                "file_road",
                "surface, obstacles and length_m belong to a track; a road file has its own",
            )
        if self.length_m is not None and self.track != "straight":
            raise PydanticCustomError("straight", "length_m belongs to the straight track only")
        if self.length_m is None and self.track == "straight":
            raise PydanticCustomError("straight", "the straight track needs its length_m")
        return self
