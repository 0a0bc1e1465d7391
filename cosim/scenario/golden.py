"""A golden signal of a scenario."""

from __future__ import annotations

from pydantic import Field

from cosim.scenario.model import with_unit
from cosim.scenario.window import Window


class Golden(Window):
    """A signal that must stay as it was when it was accepted, within a tube around it."""

    signal: str = Field(min_length=1, description="name of a recorded signal")
    tolerance: float = Field(
        gt=0, description="how far a value may lie from the golden, in the signal's unit"
    )
    time_tolerance_s: float = Field(
        default=0.0,
        ge=0,
        le=10,
        description="how far it may lie from it in time",
        json_schema_extra=with_unit("s"),
    )
