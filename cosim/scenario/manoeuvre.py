"""What is driven on the road of a scenario, where it is not simply the road."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.scenario.model import Model, with_unit

Direction = Literal["left", "right"]
_Start = Annotated[
    float | None,
    Field(
        ge=0,
        description="where it begins along the road; after two seconds of driving if not given",
        json_schema_extra=with_unit("m"),
    ),
]
_Amplitude = Annotated[
    float,
    Field(
        gt=0,
        le=300,
        description="steering-wheel angle",
        json_schema_extra=with_unit("deg"),
    ),
]
_Pedal = Annotated[float | None, Field(gt=0, le=1, description="pedal, 0 to 1")]


class ConstantSpeed(Model):
    """The road at driver.speed_kmh, whatever its bends ask for."""

    kind: Literal["constant_speed"]


class ConstantRadius(Model):
    """The circle at driver.speed_kmh, measured in its second half (ISO 4138)."""

    kind: Literal["constant_radius"]


class DoubleLaneChange(Model):
    """Obstacle avoidance through the gates of ISO 3888-2, accelerator released at the entry."""

    kind: Literal["double_lane_change"]
    start_m: _Start = None


class Slalom(Model):
    """Round cones in turn, furthest from the road's line at each cone."""

    kind: Literal["slalom"]
    spacing_m: float = Field(
        ge=8,
        le=100,
        description="distance from cone to cone",
        json_schema_extra=with_unit("m"),
    )
    cones: int = Field(default=10, ge=3, le=40, description="number of cones")
    clearance_m: float = Field(
        default=0.5,
        ge=0.1,
        le=2,
        description="planned between the cones and the vehicle's side",
        json_schema_extra=with_unit("m"),
    )
    start_m: _Start = None


class SineWithDwell(Model):
    """A period of sine at the steering wheel that dwells at its second peak (ISO 19365)."""

    kind: Literal["sine_with_dwell"]
    amplitude_deg: _Amplitude
    frequency_hz: float = Field(
        default=0.7,
        ge=0.1,
        le=2,
        description="frequency of the sine",
        json_schema_extra=with_unit("Hz"),
    )
    dwell_s: float = Field(
        default=0.5,
        ge=0,
        le=2,
        description="dwell after three quarters of the period",
        json_schema_extra=with_unit("s"),
    )
    direction: Direction = Field(default="left", description="side of the first half of the sine")
    start_m: _Start = None


class StepSteer(Model):
    """A step of the steering-wheel angle from straight driving (ISO 7401)."""

    kind: Literal["step_steer"]
    amplitude_deg: _Amplitude
    rise_s: float = Field(
        default=0.1,
        gt=0,
        le=1,
        description="duration of the ramp from nothing to the whole angle",
        json_schema_extra=with_unit("s"),
    )
    direction: Direction = Field(default="left", description="side of the step")
    start_m: _Start = None


class Brake(Model):
    """Straight braking from driver.speed_kmh with a deceleration or a pedal."""

    kind: Literal["brake"]
    deceleration_m_s2: float | None = Field(
        default=None,
        gt=0,
        le=10,
        description="deceleration that is held",
        json_schema_extra=with_unit("m/s2"),
    )
    pedal: _Pedal = None
    to_kmh: float = Field(
        default=0.0,
        ge=0,
        le=250,
        description="speed at which it ends",
        json_schema_extra=with_unit("km/h"),
    )
    start_m: _Start = None

    @model_validator(mode="after")
    def _one_demand(self) -> Brake:
        if (self.deceleration_m_s2 is None) == (self.pedal is None):
            raise PydanticCustomError("demand", "give either deceleration_m_s2 or pedal")
        return self


class Accelerate(Model):
    """Straight acceleration from driver.speed_kmh with an acceleration or a pedal."""

    kind: Literal["accelerate"]
    acceleration_m_s2: float | None = Field(
        default=None,
        gt=0,
        le=10,
        description="acceleration that is held",
        json_schema_extra=with_unit("m/s2"),
    )
    pedal: _Pedal = None
    to_kmh: float = Field(
        gt=5,
        le=250,
        description="speed at which it ends",
        json_schema_extra=with_unit("km/h"),
    )
    start_m: _Start = None

    @model_validator(mode="after")
    def _one_demand(self) -> Accelerate:
        if (self.acceleration_m_s2 is None) == (self.pedal is None):
            raise PydanticCustomError("demand", "give either acceleration_m_s2 or pedal")
        return self


class Mix(Model):
    """Random accelerating, braking, cornering and swaying from 10 km/h to driver.speed_kmh, or 120
    km/h.
    """

    kind: Literal["mix"]
    seed: int | None = Field(
        default=None, ge=0, description="of what is driven; the scenario's seed if not given"
    )


Manoeuvre = Annotated[
    ConstantSpeed
    | ConstantRadius
    | DoubleLaneChange
    | Slalom
    | SineWithDwell
    | StepSteer
    | Brake
    | Accelerate
    | Mix,
    Field(discriminator="kind"),
]
