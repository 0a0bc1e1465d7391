"""Real time in a scenario."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from cosim.scenario.model import Model, with_unit

Overrun = Literal["catch_up", "slip", "stop"]


class RealTime(Model):
    """The run goes by the clock; without this section it goes as fast as it can."""

    factor: float = Field(
        default=1.0, gt=0, le=1000, description="simulated seconds in a second of the clock"
    )
    overrun: Overrun = Field(
        default="catch_up",
        description="where a sample is not done in time: keep the deadlines, move them, or end the"
        " run",
    )
    spin_ms: float = Field(
        default=0.5,
        ge=0,
        le=10,
        description="how long before a deadline the process stays awake",
        json_schema_extra=with_unit("ms"),
    )
