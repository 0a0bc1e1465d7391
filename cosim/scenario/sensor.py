"""The virtual sensor of a scenario: which estimator, and how its channels are measured."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.errors import did_you_mean
from cosim.scenario.bus import Bus
from cosim.scenario.model import Model
from sensor.estimators import DEFAULT, names


def _check_estimator(value: object) -> object:
    if value is None or value in names():
        return value
    *others, last = names()
    context = {
        "choices": f"{', '.join(others)} or {last}",
        "hint": did_you_mean(str(value), names()),
    }
    raise PydanticCustomError("estimator", "must be {choices}", context)


EstimatorName = Annotated[str, BeforeValidator(_check_estimator)]


class Sensor(Model):
    """The virtual sensor: an estimator by name, or a network or a sensor FMU from a file."""

    estimator: Annotated[str | None, BeforeValidator(_check_estimator)] = Field(
        default=DEFAULT,
        description="name of an estimator that is shipped (docs/estimators.md)",
        json_schema_extra={"examples": list(names())},
    )
    network: str | None = Field(
        default=None,
        min_length=1,
        description="instead of an estimator, an ONNX file relative to the scenario file",
    )
    fmu: str | None = Field(
        default=None,
        min_length=1,
        description="instead of an estimator, a sensor FMU (cosim pack) relative to the scenario "
        "file",
    )
    condition: Literal["ideal", "production"] = Field(
        default="ideal",
        description="how the channels are measured: exactly, or by a car's sensors",
    )
    bus: Bus | None = Field(
        default=None,
        description="where the estimator is not in this process but on a CAN bus (docs/can.md)",
    )

    @model_validator(mode="before")
    @classmethod
    def _file_instead(cls, data: Any) -> Any:
        """A network or an FMU stands in the default estimator's place, not beside it."""
        if not isinstance(data, dict) or "estimator" in data:
            return data
        given = data.get("network") is not None or data.get("fmu") is not None
        return {**data, "estimator": None} if given else data

    @model_validator(mode="after")
    def _one_of_them(self) -> Sensor:
        given = [choice for choice in (self.estimator, self.network, self.fmu) if choice]
        if len(given) != 1:
            raise PydanticCustomError("sensor", "give either an estimator, a network or an FMU")
        return self
