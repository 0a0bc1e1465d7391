"""The surface of a road in a scenario."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from cosim.errors import did_you_mean
from cosim.scenario.model import Model, with_unit

RoadClass = Literal["A", "B", "C", "D"]
SurfaceName = Literal["smooth", "A", "B", "C", "D", "cobbles"]
SURFACE_NAMES: Final = ("smooth", "A", "B", "C", "D", "cobbles")
_SEED = "seed of the surface; the scenario's seed if not given"


class SmoothSurface(Model):
    """A surface without unevenness, as on the example roads of vehicle simulators."""

    kind: Literal["smooth"] = "smooth"

    @property
    def name(self) -> SurfaceName:
        """What a limit calls it."""
        return "smooth"


class IsoSurface(Model):
    """A random surface with the spectrum of an ISO 8608 class."""

    kind: Literal["iso8608"]
    road_class: RoadClass = Field(alias="class", description="ISO 8608 class, A the smoothest")
    seed: int | None = Field(default=None, ge=0, description=_SEED)

    @property
    def name(self) -> SurfaceName:
        """What a limit calls it."""
        return self.road_class


class CobbleSurface(Model):
    """Rows of setts, each stone of its own height, on a bed with the spectrum of a class."""

    kind: Literal["cobbles"]
    road_class: RoadClass = Field(
        default="C", alias="class", description="ISO 8608 class of the bed"
    )
    stone_length_m: float = Field(
        default=0.16,
        ge=0.1,
        le=0.5,
        description="mean length of a stone and its joint along the road",
        json_schema_extra=with_unit("m"),
    )
    stone_width_m: float = Field(
        default=0.18,
        ge=0.1,
        le=0.5,
        description="mean width of a stone and its joint across the road",
        json_schema_extra=with_unit("m"),
    )
    height_m: float = Field(
        default=0.003,
        ge=0,
        le=0.02,
        description="standard deviation of the stones' heights",
        json_schema_extra=with_unit("m"),
    )
    crown_m: float = Field(
        default=0.006,
        ge=0,
        le=0.03,
        description="from the middle of a stone down to its joints, as a tread feels it",
        json_schema_extra=with_unit("m"),
    )
    seed: int | None = Field(default=None, ge=0, description=_SEED)

    @property
    def name(self) -> SurfaceName:
        """What a limit calls it."""
        return "cobbles"


def _spelt_out(value: object) -> object:
    """Return the mapping that a surface's name stands for."""
    if isinstance(value, dict | Model):
        if isinstance(value, dict) and value.get("kind") in ("bumps", "hump", "pothole"):
            sentence = f"kind {value['kind']} lies on a surface: put it under road.obstacles"
            raise PydanticCustomError("obstacle", sentence)
        return value
    if value in ("A", "B", "C", "D"):
        return {"kind": "iso8608", "class": value}
    if value in ("smooth", "cobbles"):
        return {"kind": value}
    raise PydanticCustomError(
        "surface",
        "must be smooth, A, B, C, D or cobbles, or a mapping with kind: smooth, iso8608 or cobbles",
        {"hint": did_you_mean(str(value), SURFACE_NAMES)},
    )


_Kinds = Annotated[SmoothSurface | IsoSurface | CobbleSurface, Field(discriminator="kind")]
Surface = Annotated[
    _Kinds, BeforeValidator(_spelt_out, json_schema_input_type=SurfaceName | _Kinds)
]
