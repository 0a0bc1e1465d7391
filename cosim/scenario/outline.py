"""The body's outline of a scenario's vehicle."""

from __future__ import annotations

from pydantic import Field

from cosim.scenario.model import Model, with_unit


class Outline(Model):
    """The rectangle of the body seen from above, around the reference point `Car.tx`, `Car.ty`."""

    width_m: float = Field(
        gt=0.5, le=3, description="width without mirrors", json_schema_extra=with_unit("m")
    )
    front_m: float = Field(
        ge=0,
        le=10,
        description="front end ahead of the reference point",
        json_schema_extra=with_unit("m"),
    )
    rear_m: float = Field(
        ge=0,
        le=10,
        description="rear end behind the reference point",
        json_schema_extra=with_unit("m"),
    )
    left_m: float | None = Field(
        default=None,
        gt=0,
        le=3,
        description="left side from the reference point, half the width if not given",
        json_schema_extra=with_unit("m"),
    )


# A Range Rover Evoque without its mirrors, 1.90 m wide and 4.37 m long (maker's data, rounded), on
# the published wheelbase of 2.675 m; overhangs of 0.88 m in front and 0.815 m behind are assumed.
# The reference point is the centre of gravity, 34.5 mm left of the middle.
EVOQUE = Outline(width_m=1.90, front_m=2.319, rear_m=2.051, left_m=0.9155)
