"""The vehicle of a scenario: its FMU, parameters and channel map."""

from __future__ import annotations

from math import isfinite
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.scenario.model import Model
from cosim.scenario.outline import EVOQUE, Outline


def _check_parameter(value: object) -> object:
    if isinstance(value, bool | int | str) or (isinstance(value, float) and isfinite(value)):
        return value
    raise PydanticCustomError("parameter", "must be one finite number, true, false or text")


class Variable(Model):
    """Which variable of another FMU carries a quantity."""

    name: str = Field(min_length=1, description="name of the variable in the FMU")
    unit: str | None = Field(default=None, description="its unit, if the FMU does not say")
    scale: float = Field(default=1.0, description="factor to the SI unit or to the sign used here")


Parameter = Annotated[bool | float | str, BeforeValidator(_check_parameter)]


def _listed(value: object) -> object:
    return (value,) if isinstance(value, str) else value


class Vehicle(Model):
    """The vehicle FMU and its parameters."""

    fmu: str = Field(
        default="builtin",
        min_length=1,
        description="'builtin', or an FMU relative to the scenario file",
    )
    fmi_version: Literal[2, 3] = Field(
        default=3, description="which of the built-in FMUs; builtin only"
    )
    variants: Annotated[
        tuple[str, ...], BeforeValidator(_listed, json_schema_input_type=str | tuple[str, ...])
    ] = Field(
        default=(),
        strict=False,
        description="sets of parameters by name or by a YAML file relative to the scenario file",
    )
    parameters: dict[str, Parameter] = Field(
        default_factory=dict,
        description="start values by the FMU's names, in its units; they override variants",
    )
    variables: dict[str, Variable] = Field(
        default_factory=dict, description="quantity to variable, for an FMU with other names"
    )
    outline: Outline = Field(
        default=EVOQUE, description="the body seen from above, which has to clear cones"
    )

    @model_validator(mode="after")
    def _builtin_only(self) -> Vehicle:
        if self.fmu == "builtin" and self.variables:
            raise PydanticCustomError(
                "builtin", "variables maps another FMU's names; the built-in FMU needs none"
            )
        if self.fmu != "builtin" and "fmi_version" in self.model_fields_set:
            raise PydanticCustomError(
                "builtin", "fmi_version chooses a built-in FMU; another FMU states its own version"
            )
        return self
