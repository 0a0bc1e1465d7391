"""The bus of a scenario whose sensor is in another process or on a bench."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from cosim.scenario.model import Model, with_unit


def _check_channel(value: object) -> object:
    """Refuse with one sentence what a union would refuse with two."""
    if value is None or (isinstance(value, str | int) and not isinstance(value, bool)):
        return value
    raise PydanticCustomError("channel", "must be text or a whole number")


def _check_option(value: object) -> object:
    if isinstance(value, str | int | float):
        return value
    raise PydanticCustomError("option", "must be text, a number, true or false")


Option = Annotated[str | int | float | bool, BeforeValidator(_check_option)]


class Bus(Model):
    """A CAN bus between the vehicle and the sensor (docs/can.md)."""

    interface: str = Field(
        default="udp_multicast",
        min_length=1,
        description="interface of python-can",
        json_schema_extra={"examples": ["udp_multicast", "socketcan", "virtual", "pcan", "vector"]},
    )
    channel: Annotated[str | int | None, BeforeValidator(_check_channel)] = Field(
        default=None, description="channel of the interface, such as can0 or a multicast address"
    )
    options: dict[str, Option] = Field(
        default_factory=dict,
        description="what else the interface is given, such as bitrate or port",
    )
    deadline_ms: float = Field(
        default=100.0,
        ge=0,
        description="how long a sample waits for its answer; 0: it takes what has come until then",
        json_schema_extra=with_unit("ms"),
    )
    oldest_samples: int = Field(
        default=0, ge=0, description="age in samples of the oldest estimate that counts"
    )
    connect_s: float = Field(
        default=30.0,
        gt=0,
        description="how long the run waits for a sensor before its first sample",
        json_schema_extra=with_unit("s"),
    )
    start_node: bool = Field(
        default=False, description="whether the run starts and ends a sensor node of its own"
    )

    @property
    def is_private(self) -> bool:
        """Whether each run finds a bus of its own, so that runs at the same time do not meet."""
        return self.start_node and self.interface == "udp_multicast" and "port" not in self.options
