"""Which channels a fault acts on, and its values in their unit."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, Field, ValidationInfo, WithJsonSchema
from pydantic_core import PydanticCustomError

from cosim.check.unit_names import readings
from cosim.errors import did_you_mean
from cosim.scenario.vehicle import Variable
from sensor.channels import CHANNEL_NAMES, CHANNELS

GROUPS: Final[dict[str, tuple[str, ...]]] = {
    "all": CHANNEL_NAMES,
    "imu": CHANNEL_NAMES[0:6],
    "accelerations": CHANNEL_NAMES[0:3],
    "angular_rates": CHANNEL_NAMES[3:6],
    "wheel_speeds": CHANNEL_NAMES[9:13],
    "steering": tuple(name for name in CHANNEL_NAMES if "Steer" in name),
}
"""Channels that have a name together."""
_UNITS: Final = {channel.name: channel.unit for channel in CHANNELS}
_EXAMPLES: Final = {"m/s2": "0.5 m/s2", "rad/s": "2 deg/s", "m/s": "3 km/h", "rad": "5 deg"}


def indices(names: Iterable[str]) -> tuple[int, ...]:
    """Return the places of channels and groups among the 14, rising, each once."""
    every = {one for name in names for one in GROUPS.get(name, (name,))}
    return tuple(i for i, name in enumerate(CHANNEL_NAMES) if name in every)


def _channels(value: object) -> object:
    """Accept one name or a list of names; refuse names that are neither channel nor group."""
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list | tuple) or not names:
        raise PydanticCustomError(
            "channels", "must be a channel, a group of channels, or a list of them"
        )
    for name in names:
        if name not in CHANNEL_NAMES and name not in GROUPS:
            hint = did_you_mean(str(name), (*CHANNEL_NAMES, *GROUPS))
            raise PydanticCustomError(
                "channel",
                "'{name}' is no channel and no group of channels{hint}",
                {"name": str(name), "hint": hint or f", which are {', '.join(GROUPS)}"},
            )
    return tuple(names)


_NAME: Final[dict[str, Any]] = {"enum": [*GROUPS, *CHANNEL_NAMES], "type": "string"}
Channels = Annotated[
    tuple[str, ...],
    BeforeValidator(_channels),
    WithJsonSchema({"anyOf": [_NAME, {"items": _NAME, "minItems": 1, "type": "array"}]}),
    Field(description="a channel, a group, or a list of them"),
]


def _in_unit(value: object, info: ValidationInfo, per_second: bool) -> object:
    """Return a number in the unit of the fault's channels, or in that per second."""
    if value is None:
        return None
    number, unit = _split(value)
    names = info.data.get("channels")
    if names is None:  # wrong themselves, and reported
        return number
    units = sorted({_UNITS[CHANNEL_NAMES[i]] for i in indices(names)})
    if len(units) > 1:
        raise PydanticCustomError(
            "mixed_units",
            "cannot be one value for channels in {units}; give a fault for each",
            {"units": " and ".join(units)},
        )
    return number if unit is None else number * _factor(unit, units[0], per_second)


def _split(value: object) -> tuple[float, str | None]:
    """Return number and unit of `0.5` or `0.5 m/s2`."""
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return float(value), None
    found = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(\S.*?)\s*", str(value))
    try:
        if isinstance(value, str) and found and math.isfinite(float(found[1])):
            return float(found[1]), found[2]
    except ValueError:
        pass
    raise PydanticCustomError(
        "quantity",
        "must be a finite number, in the channels' SI unit or followed by its unit as in '2 deg/s'",
    )


def _factor(unit: str, channels: str, per_second: bool) -> float:
    """Return the factor from `unit` to the channels' unit, or to that per second."""
    wanted = f"{channels}/s" if per_second else channels
    expected = readings(wanted)[0].exponents
    fits = [reading for reading in readings(unit) if reading.exponents == expected]
    if not fits:
        example = _EXAMPLES[channels] + ("/min" if per_second else "")
        raise PydanticCustomError(
            "unit",
            "'{unit}' is no unit for {wanted}; write it as in '{example}'",
            {"unit": unit, "wanted": wanted, "example": example},
        )
    return fits[0].factor


def in_si(channel: str, variable: Variable) -> Variable:
    """Return the variable that stands for a channel with the factor of its unit in its scale."""
    if channel not in CHANNEL_NAMES:
        raise PydanticCustomError(
            "channel",
            "'{name}' is no channel{hint}",
            {"name": channel, "hint": did_you_mean(channel, CHANNEL_NAMES)},
        )
    if variable.unit is None:
        return variable
    factor = _factor(variable.unit, _UNITS[channel], per_second=False)
    return variable.model_copy(update={"unit": None, "scale": variable.scale * factor})


def _value(value: object, info: ValidationInfo) -> object:
    return _in_unit(value, info, per_second=False)


def _rate(value: object, info: ValidationInfo) -> object:
    return _in_unit(value, info, per_second=True)


Value = Annotated[
    float,
    BeforeValidator(_value, json_schema_input_type=float | str),
    Field(json_schema_extra={"unit_of": "channels"}),
]
"""A value in the unit of the fault's channels, which are a field before it."""
OptionalValue = Annotated[
    float | None,
    BeforeValidator(_value, json_schema_input_type=float | str | None),
    Field(json_schema_extra={"unit_of": "channels"}),
]
"""The same, or none."""
Rate = Annotated[
    float,
    BeforeValidator(_rate, json_schema_input_type=float | str),
    Field(json_schema_extra={"unit_of": "channels, per second"}),
]
"""A value in the unit of the fault's channels per second."""
