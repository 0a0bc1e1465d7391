"""What may stand in a scenario file, as pydantic models and as a JSON Schema.

Numbers are in the unit that the field's name ends with; the unit also travels in the JSON Schema,
so that an editor and an error message show the same one. Every model is frozen and refuses unknown
fields.

`python -m cosim.scenario.schema > scenarios/schema.json` writes the JSON Schema.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from cosim.errors import Place, Problem, did_you_mean
from cosim.scenario.source import Key, Source

SCHEMA_ID: Final = "https://json-schema.org/draft/2020-12/schema"
NAME_PATTERN: Final = r"^[a-z][a-z0-9_]*$"


def _with_unit(unit: str) -> dict[str, Any]:
    return {"unit": unit}


def _check_duration(value: object) -> object:
    """Refuse with one sentence what a union would refuse with two."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value == "lap" or (number and 0 < float(value) < float("inf")):  # type: ignore[arg-type]
        return value
    raise PydanticCustomError("duration", "must be 'lap' or a number of seconds greater than 0")


def _check_parameter(value: object) -> object:
    if isinstance(value, bool | int | str) or (isinstance(value, float) and isfinite(value)):
        return value
    raise PydanticCustomError("parameter", "must be one finite number, true, false or text")


class Model(BaseModel):
    """Base of every part of a scenario: frozen, no unknown fields, no silent conversions."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, validate_default=False
    )


class SmoothSurface(Model):
    """A surface without unevenness, as on the example roads of vehicle simulators."""

    kind: Literal["smooth"] = "smooth"


class IsoSurface(Model):
    """A random surface with the spectrum of an ISO 8608 class."""

    kind: Literal["iso8608"]
    road_class: Literal["A", "B", "C", "D"] = Field(
        alias="class", description="ISO 8608 class, A the smoothest"
    )
    seed: int | None = Field(
        default=None, ge=0, description="seed of the surface; the scenario's seed if not given"
    )


class BumpSurface(Model):
    """Cosine bumps, alternately below the left and the right wheels."""

    kind: Literal["bumps"]
    height_m: float = Field(
        gt=0, le=0.3, description="height of a bump", json_schema_extra=_with_unit("m")
    )
    length_m: float = Field(
        gt=0, description="length of a bump along the road", json_schema_extra=_with_unit("m")
    )
    spacing_m: float = Field(
        gt=0,
        description="distance from one bump to the next on the same side",
        json_schema_extra=_with_unit("m"),
    )

    @model_validator(mode="after")
    def _bumps_do_not_overlap(self) -> BumpSurface:
        if self.spacing_m < self.length_m:
            raise PydanticCustomError(
                "overlap",
                "spacing_m ({spacing} m) must not be less than length_m ({length} m)",
                {"spacing": self.spacing_m, "length": self.length_m},
            )
        return self


Surface = Annotated[SmoothSurface | IsoSurface | BumpSurface, Field(discriminator="kind")]


class Road(Model):
    """The road: one of the tracks with a surface, or an OpenCRG file."""

    track: Literal["hockenheim", "heilbronn", "rural", "straight"] | None = Field(
        default=None, description="layout of the road"
    )
    surface: Surface = Field(default=SmoothSurface(), description="unevenness laid over the track")
    length_m: float | None = Field(
        default=None,
        ge=10,
        le=20_000,
        description="length of the straight track",
        json_schema_extra=_with_unit("m"),
    )
    file: str | None = Field(
        default=None, min_length=1, description="an OpenCRG file, relative to the scenario file"
    )

    @model_validator(mode="after")
    def _one_road(self) -> Road:
        given = self.model_fields_set
        if (self.track is None) == (self.file is None):
            raise PydanticCustomError("one_road", "give either track or file")
        if self.file is not None and given & {"surface", "length_m"}:
            raise PydanticCustomError(
                "file_road", "surface and length_m belong to a track; a road file has its own"
            )
        if self.length_m is not None and self.track != "straight":
            raise PydanticCustomError("straight", "length_m belongs to the straight track only")
        if self.length_m is None and self.track == "straight":
            raise PydanticCustomError("straight", "the straight track needs its length_m")
        return self


class Driver(Model):
    """The driver: how hard he accelerates, brakes and corners, and how fast he may go."""

    style: Literal["aggressive", "normal", "defensive"] = Field(
        default="normal", description="limits of longitudinal and lateral acceleration"
    )
    speed_kmh: float | None = Field(
        default=None,
        ge=5,
        le=250,
        description="start at this speed and never exceed it",
        json_schema_extra=_with_unit("km/h"),
    )


class Variable(Model):
    """Which variable of another vehicle FMU carries a quantity."""

    name: str = Field(min_length=1, description="name of the variable in the FMU")
    unit: str | None = Field(default=None, description="its unit, if the FMU does not say")
    scale: float = Field(default=1.0, description="factor to the SI unit or to the sign used here")


Parameter = Annotated[bool | float | str, BeforeValidator(_check_parameter)]


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
    parameters: dict[str, Parameter] = Field(
        default_factory=dict, description="start values by the FMU's own names, in its units"
    )
    variables: dict[str, Variable] = Field(
        default_factory=dict, description="quantity to variable, for an FMU with other names"
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


class Sensor(Model):
    """The virtual sensor."""

    network: str = Field(
        default="default",
        min_length=1,
        description="'default', or an ONNX file beside the scenario",
    )


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
        json_schema_extra=_with_unit("N s/m"),
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


class Output(Model):
    """How the signals are written."""

    format: Literal["csv", "parquet"] = Field(
        default="csv", description="file format of the signals"
    )


class Limit(Model):
    """A bound on one metric; the run fails when it is crossed."""

    metric: str = Field(min_length=1, description="dotted path in metrics.json")
    min: float | None = Field(default=None, description="smallest value that passes")
    max: float | None = Field(default=None, description="largest value that passes")

    @model_validator(mode="after")
    def _some_bound(self) -> Limit:
        if self.min is None and self.max is None:
            raise PydanticCustomError("no_bound", "a limit needs min, max or both")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise PydanticCustomError(
                "crossed",
                "min ({low}) must not be greater than max ({high})",
                {"low": self.min, "high": self.max},
            )
        return self


class Scenario(Model):
    """One co-simulation: road, driver, vehicle, sensor, controllers, output and limits."""

    name: str = Field(min_length=1, description="one line, the headline of the report")
    description: str = Field(default="", description="what the scenario shows")
    duration: Annotated[Literal["lap"] | float, BeforeValidator(_check_duration)] = Field(
        default="lap",
        description="'lap' for once along the road, or seconds",
        json_schema_extra=_with_unit("s"),
    )
    seed: int = Field(default=1, ge=0, description="seed of everything random in the scenario")
    road: Road
    driver: Driver = Driver()
    vehicle: Vehicle = Vehicle()
    sensor: Sensor = Sensor()
    controllers: tuple[Controller, ...] = Field(
        default=(Passive(kind="passive"),), strict=False, min_length=1, description="one run each"
    )
    output: Output = Output()
    limits: tuple[Limit, ...] = Field(default=(), strict=False, description="what must hold")
    paper_row: str | None = Field(
        default=None, description="row of the paper's Table 4 that the result is shown beside"
    )

    _source: Source = PrivateAttr(default_factory=Source)

    @field_validator("controllers")
    @classmethod
    def _labels_differ(cls, value: tuple[Controller, ...]) -> tuple[Controller, ...]:
        labels = [controller.label for controller in value]
        for label in labels:
            if labels.count(label) > 1:
                raise PydanticCustomError(
                    "labels", "two runs are called '{label}'; give one a name", {"label": label}
                )
        return value

    @property
    def file(self) -> Path | None:
        """The file that the scenario was read from."""
        return self._source.path

    def resolve(self, path: str) -> Path:
        """Return a path of the scenario; relative ones start at the scenario file's folder."""
        return self._source.folder / path

    def locate(self, key: Key) -> Place | None:
        """Return where a field stands (`.line`, `.column`, `.source`); None without a file.

        `key` is the path from the top, such as `("vehicle", "parameters", "Body.Mass")`; what is
        not in the file stands where the nearest part above it does.
        """
        return self._source.locate(key)

    def problem(
        self, key: Key, message: str, choices: Sequence[str] = (), name: str = ""
    ) -> Problem:
        """Return a problem at `key` for a later check to raise in an `InputError`.

        With `choices`, the sentence ends with the choice nearest to `name`, the word that is wrong.
        Where that is the key's own last part, the key is underlined, else the value.
        """
        wrong = name or str(key[-1])
        hint = did_you_mean(wrong, choices) if choices else ""
        at_key = bool(choices) and wrong == key[-1]
        return Problem(message + hint, self._source.locate(key, at_key))


@cache
def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a scenario file."""
    return {"$schema": SCHEMA_ID, **Scenario.model_json_schema(by_alias=True)}


if __name__ == "__main__":
    json.dump(json_schema(), sys.stdout, indent=2, ensure_ascii=False)
    sys.stdout.write("\n")
