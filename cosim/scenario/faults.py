"""The faults of a scenario: what happens to the channels between measurement and sensor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Final, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from cosim.scenario.fault_channels import Channels, OptionalValue, Rate, Value, in_si
from cosim.scenario.model import NAME_PATTERN, Model, with_unit
from cosim.scenario.vehicle import Variable

Corner = Literal["FL", "FR", "RL", "RR"]
SAMPLE_S: Final = 0.01
_IN_UNIT: Final = "in the channels' SI unit, or text with its unit such as '2 deg/s'"


class _Timed(Model):
    """A fault acts on the samples at t with start_s <= t < end_s."""

    name: str | None = Field(
        default=None,
        pattern=NAME_PATTERN,
        description="name in figures and report; its kind if none",
    )
    start_s: float = Field(
        default=0.0,
        ge=0,
        description="first sample that it acts on",
        json_schema_extra=with_unit("s"),
    )
    end_s: float | None = Field(
        default=None,
        description="first sample that it leaves alone again; the end of the run if not given",
        json_schema_extra=with_unit("s"),
    )

    @field_validator("end_s")
    @classmethod
    def _end_after_start(cls, value: float | None, info: ValidationInfo) -> float | None:
        start = info.data.get("start_s")
        if value is not None and start is not None and value <= start:
            raise PydanticCustomError(
                "order",
                "must be after start_s, which is {start} s",
                {"start": f"{start:g}"},
            )
        return value


class _Ramped(_Timed):
    """Grows from nothing after its start, and back to nothing before its end."""

    ramp_s: float = Field(
        default=0.0,
        ge=0,
        description="time to grow to full size from the start, and to fade before the end",
        json_schema_extra=with_unit("s"),
    )

    @field_validator("ramp_s")
    @classmethod
    def _ramp_has_room(cls, value: float, info: ValidationInfo) -> float:
        start, end = info.data.get("start_s"), info.data.get("end_s")
        if start is not None and end is not None and 2 * value > (end - start) * (1 + 1e-9):
            raise PydanticCustomError(
                "ramp",
                "must be at most half the time from start_s to end_s, {half} s",
                {"half": f"{(end - start) / 2:g}"},
            )
        return value


class _Random(Model):
    """What a fault draws depends on the scenario's seed and its own."""

    seed: int | None = Field(
        default=None, ge=0, description="seed of its own; its place in the list if not given"
    )


class Noise(_Ramped, _Random):
    """White noise with a normal distribution, of each channel by itself."""

    kind: Literal["noise"]
    channels: Channels
    rms: Value = Field(gt=0, description=f"standard deviation, {_IN_UNIT}")


class Bias(_Ramped):
    """An offset."""

    kind: Literal["bias"]
    channels: Channels
    value: Value = Field(description=f"what is added, {_IN_UNIT}")


class Drift(_Ramped):
    """An offset that grows with time from the start, and is gone after the end."""

    kind: Literal["drift"]
    channels: Channels
    rate: Rate = Field(
        description="growth per second, in the channels' SI unit per s, or text such as "
        "'0.1 m/s2/min'"
    )


class Gain(_Ramped):
    """A wrong scale."""

    kind: Literal["gain"]
    channels: Channels
    factor: float = Field(description="the channel is multiplied by it; -1 changes its sign")


class Quantisation(_Ramped):
    """Digital steps: the nearest multiple of a step; a ramp lets the step grow."""

    kind: Literal["quantisation"]
    channels: Channels
    step: Value = Field(gt=0, description=f"size of a step, {_IN_UNIT}")


class Saturation(_Timed):
    """A range that the channel cannot leave."""

    kind: Literal["saturation"]
    channels: Channels
    min: OptionalValue = Field(default=None, description=f"least value, {_IN_UNIT}")
    max: OptionalValue = Field(default=None, description=f"greatest value, {_IN_UNIT}")

    @model_validator(mode="after")
    def _some_end(self) -> Saturation:
        if self.min is None and self.max is None:
            raise PydanticCustomError("no_bound", "a saturation needs min, max or both")
        if self.min is not None and self.max is not None and self.min >= self.max:
            raise PydanticCustomError("crossed", "min must be less than max")
        return self


class Delay(_Ramped):
    """The channels are read as they were a while ago, interpolated between samples."""

    kind: Literal["delay"]
    channels: Channels
    delay_ms: float = Field(
        gt=0, le=1000, description="age of what is read", json_schema_extra=with_unit("ms")
    )


class Jitter(_Ramped, _Random):
    """The age of what is read varies, all channels alike: uniform from 0 on, anew at each sample,
    but never back to what is older than the last reading.
    """

    kind: Literal["jitter"]
    channels: Channels
    max_ms: float = Field(
        gt=0, le=1000, description="greatest age", json_schema_extra=with_unit("ms")
    )


class Dropout(_Ramped, _Random):
    """Samples that are missing, on all its channels at once; a ramp lets their share grow."""

    kind: Literal["dropout"]
    channels: Channels
    fill: Literal["hold", "nan"] = Field(
        description="what stands in the place of a missing sample: the last one that came, or NaN"
    )
    share: float = Field(
        default=1.0, gt=0, le=1, description="share of the samples that is missing"
    )
    outage_s: float | None = Field(
        default=None,
        ge=SAMPLE_S,
        description="mean length of an outage; if not given, each sample is missing by itself",
        json_schema_extra=with_unit("s"),
    )

    @field_validator("outage_s")
    @classmethod
    def _gaps_between(cls, value: float | None, info: ValidationInfo) -> float | None:
        """Outages of n samples in the mean have gaps of at least one sample between them."""
        share = info.data.get("share")
        if value is None or share is None or share == 1.0:
            return value
        least = SAMPLE_S * share / (1.0 - share)
        if value < least * (1.0 - 1e-9):
            raise PydanticCustomError(
                "outage",
                "must be at least {least} s where a share of {share} is missing",
                {"least": f"{least:.3g}", "share": f"{share:g}"},
            )
        return value


class Stuck(_Timed):
    """The channel does not change: it keeps its value at the start, or has one."""

    kind: Literal["stuck"]
    channels: Channels
    value: OptionalValue = Field(
        default=None, description=f"what it shows, {_IN_UNIT}; its value at the start if not given"
    )


class Spikes(_Ramped, _Random):
    """Single samples that are off, upward or downward, of each channel by itself."""

    kind: Literal["spikes"]
    channels: Channels
    height: Value = Field(gt=0, description=f"how far, {_IN_UNIT}")
    rate_hz: float = Field(
        gt=0, le=100, description="spikes per second in the mean", json_schema_extra=with_unit("Hz")
    )


class SwappedWheels(_Timed):
    """Two wheel-speed sensors are connected to each other's plugs."""

    kind: Literal["swapped_wheels"]
    wheels: tuple[Corner, Corner] = Field(strict=False, description="the two wheels")

    @field_validator("wheels")
    @classmethod
    def _two(cls, value: tuple[Corner, Corner]) -> tuple[Corner, Corner]:
        if value[0] == value[1]:
            raise PydanticCustomError("two_wheels", "must be two different wheels")
        return value


class OspScenario(Model):
    """Events of a scenario file of the Open Simulation Platform: override, bias and reset."""

    kind: Literal["osp_scenario"]
    name: str | None = Field(
        default=None, pattern=NAME_PATTERN, description="name in figures and report"
    )
    file: str = Field(min_length=1, description="JSON or YAML file, relative to the scenario file")
    model: str | None = Field(
        default=None, description="the model that is the vehicle; events of others are left out"
    )
    variables: dict[str, Variable] = Field(
        default_factory=dict, description="channel to the variable that stands for it in the file"
    )

    @field_validator("variables")
    @classmethod
    def _channels_in_si(cls, value: dict[str, Variable]) -> dict[str, Variable]:
        """Return the variables with all of the way to the channels' unit in their scale."""
        return {channel: in_si(channel, variable) for channel, variable in value.items()}


PlainFault = (
    Noise
    | Bias
    | Drift
    | Gain
    | Quantisation
    | Saturation
    | Delay
    | Jitter
    | Dropout
    | Stuck
    | Spikes
    | SwappedWheels
)
Fault = Annotated[PlainFault | OspScenario, Field(discriminator="kind")]


def labels(faults: Sequence[Fault]) -> list[str]:
    """Return what each fault is called: its name or its kind, numbered where it comes again."""
    return numbered([fault.name or fault.kind for fault in faults])


def numbered(names: Sequence[str]) -> list[str]:
    """Return names with _2, _3 ... at those that stand there for the second time and so on."""
    before = [names[:i].count(name) for i, name in enumerate(names)]
    return [f"{n}_{k + 1}" if k else n for n, k in zip(names, before, strict=True)]
