"""The controllers of a scenario; each makes one run."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cosim.scenario.model import NAME_PATTERN, Model, with_unit


class Passive(Model):
    """No controller: the dampers follow their passive curve."""

    kind: Literal["passive"]
    name: str | None = Field(default=None, pattern=NAME_PATTERN, description="name of the run")

    @property
    def label(self) -> str:
        """Name of the run."""
        return self.name or "passive"


class Skyhook(Model):
    """Continuous skyhook control of the four dampers."""

    kind: Literal["skyhook"]
    feedback: Literal["truth", "estimate"] = Field(
        default="estimate", description="suspension velocity that the controller is given"
    )
    gain_ns_per_m: float | None = Field(
        default=None,
        gt=0,
        description="skyhook damping of one corner",
        json_schema_extra=with_unit("N s/m"),
    )
    initial_command: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="damper command until the first valid estimate, 0 soft, 1 hard",
    )
    name: str | None = Field(default=None, pattern=NAME_PATTERN, description="name of the run")

    @property
    def label(self) -> str:
        """Name of the run."""
        return self.name or f"skyhook_{self.feedback}"


Controller = Annotated[Passive | Skyhook, Field(discriminator="kind")]
