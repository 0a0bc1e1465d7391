"""The road of a scenario."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.scenario.model import Model, with_unit
from cosim.scenario.obstacles import Obstacle
from cosim.scenario.surface import SmoothSurface, Surface, SurfaceName

# Fields that describe some tracks only
_TRACKS_OWN: Final = {
    "length_m": ("straight", "winding"),
    "seed": ("winding",),
    "radius_m": ("circle",),
    "angle_deg": ("circle",),
    "direction": ("circle",),
}


class Road(Model):
    """The road: one of the tracks with a surface, or an OpenCRG file."""

    track: Literal["hockenheim", "heilbronn", "rural", "straight", "circle", "winding"] | None = (
        Field(default=None, description="layout of the road")
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
        description="length of the straight track, long enough for the manoeuvre if not given, or "
        "of the winding one",
        json_schema_extra=with_unit("m"),
    )
    seed: int | None = Field(
        default=None,
        ge=0,
        description="seed of the winding track's bends; the scenario's seed if not given",
    )
    radius_m: float | None = Field(
        default=None,
        ge=10,
        le=1000,
        description="radius of the circle",
        json_schema_extra=with_unit("m"),
    )
    angle_deg: float | None = Field(
        default=None,
        ge=30,
        le=360,
        description="angle that the circle turns by, 270 deg if not given",
        json_schema_extra=with_unit("deg"),
    )
    direction: Literal["left", "right"] | None = Field(
        default=None, description="side that the circle turns to, left if not given"
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
        if self.file is not None and given & {"surface", "obstacles", *_TRACKS_OWN}:
            raise PydanticCustomError(
                "file_road",
                "surface, obstacles and length_m belong to a track; a road file has its own",
            )
        for field, tracks in _TRACKS_OWN.items():
            if getattr(self, field) is not None and self.track not in tracks:
                message = "{field} belongs to the {tracks} track only"
                names = {"field": field, "tracks": " or the ".join(tracks)}
                raise PydanticCustomError("track", message, names)
        if self.track == "circle" and self.radius_m is None:
            raise PydanticCustomError("circle", "the circle needs its radius_m")
        if self.track == "winding" and self.length_m is None:
            raise PydanticCustomError("winding", "the winding track needs its length_m")
        return self
