"""The driver of a scenario."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from cosim.scenario.model import Model, with_unit


class Driver(Model):
    """The driver: how hard he accelerates, brakes and corners, and how fast he may go."""

    style: Literal["aggressive", "normal", "defensive"] = Field(
        default="normal", description="limits of longitudinal and lateral acceleration"
    )
    speed_kmh: float | None = Field(
        default=None,
        ge=5,
        le=250,
        description="start at this speed and never exceed it; that of the manoeuvre",
        json_schema_extra=with_unit("km/h"),
    )
