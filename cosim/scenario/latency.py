"""Latencies of a scenario: how late the sensor's estimate and the damper command arrive."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from cosim.scenario.model import Model, with_unit

SAMPLE_MS: Final = 10.0


def _whole_samples(value: float) -> float:
    if value % SAMPLE_MS:
        raise PydanticCustomError(
            "samples", "must be a multiple of {step} ms, the time of a sample", {"step": "10"}
        )
    return value


_Late = Annotated[float, Field(ge=0, le=1000), AfterValidator(_whole_samples)]


class Latency(Model):
    """Latencies in the loop, on top of those of the measurement."""

    sensor_ms: _Late = Field(
        default=0.0,
        description="from a sample until the controller has its estimate",
        json_schema_extra=with_unit("ms"),
    )
    damper_ms: _Late = Field(
        default=0.0,
        description="from the controller's command until the dampers have it",
        json_schema_extra=with_unit("ms"),
    )
