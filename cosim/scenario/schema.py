"""What may stand in a scenario file, as pydantic models and as a JSON Schema.

Numbers are in the unit that the field's name ends with; the unit also travels in the JSON Schema,
so that an editor and an error message show the same one. Every model is frozen and refuses unknown
fields. Each part of a scenario has a module beside this one.

`python -m cosim.scenario.schema > scenarios/schema.json` writes the JSON Schema.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field, PrivateAttr, field_validator, model_validator
from pydantic_core import PydanticCustomError

from cosim.errors import Place, Problem, did_you_mean
from cosim.scenario.controllers import Controller, Passive
from cosim.scenario.driver import Driver
from cosim.scenario.faults import Fault, OspScenario, labels
from cosim.scenario.golden import Golden
from cosim.scenario.latency import Latency
from cosim.scenario.limit import Limit
from cosim.scenario.manoeuvre import Manoeuvre
from cosim.scenario.model import Model, with_unit
from cosim.scenario.osp_scenario import Acting, acting
from cosim.scenario.real_time import RealTime
from cosim.scenario.road import Road
from cosim.scenario.sensor import Sensor
from cosim.scenario.source import Key, Source
from cosim.scenario.variants import Value, Variants
from cosim.scenario.vehicle import Vehicle

SCHEMA_ID: Final = "https://json-schema.org/draft/2020-12/schema"


def _check_duration(value: object) -> object:
    """Refuse with one sentence what a union would refuse with two."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value == "lap" or (number and 0 < float(value) < float("inf")):  # type: ignore[arg-type]
        return value
    raise PydanticCustomError("duration", "must be 'lap' or a number of seconds greater than 0")


class Output(Model):
    """How the signals are written."""

    format: Literal["csv", "parquet"] = Field(
        default="csv", description="file format of the signals"
    )


class Scenario(Model):
    """One co-simulation: road, driver, vehicle, sensor, controllers, output and limits."""

    name: str = Field(min_length=1, description="one line, the headline of the report")
    description: str = Field(default="", description="what the scenario shows")
    duration: Annotated[Literal["lap"] | float, BeforeValidator(_check_duration)] = Field(
        default="lap",
        description="'lap' for once along the road or the whole manoeuvre, or seconds",
        json_schema_extra=with_unit("s"),
    )
    seed: int = Field(default=1, ge=0, description="seed of everything random in the scenario")
    road: Road
    manoeuvre: Manoeuvre | None = Field(
        default=None, description="what is driven on the road; the road itself if not given"
    )
    driver: Driver = Driver()
    vehicle: Vehicle = Vehicle()
    sensor: Sensor = Sensor()
    faults: tuple[Fault, ...] = Field(
        default=(), strict=False, description="what happens to the channels, in this order"
    )
    latency: Latency = Latency()
    controllers: tuple[Controller, ...] = Field(
        default=(Passive(kind="passive"),), strict=False, min_length=1, description="one run each"
    )
    output: Output = Output()
    real_time: RealTime | None = Field(
        default=None, description="go by the clock; as fast as possible if not given"
    )
    limits: tuple[Limit, ...] = Field(default=(), strict=False, description="what must hold")
    goldens: tuple[Golden, ...] = Field(
        default=(), strict=False, description="what must stay as it was, for `cosim test`"
    )
    paper_row: str | None = Field(
        default=None, description="row of the paper's Table 4 that the result is shown beside"
    )

    _source: Source = PrivateAttr(default_factory=Source)
    _variants: Variants = PrivateAttr(default_factory=Variants)

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

    @field_validator("faults")
    @classmethod
    def _faults_differ(cls, value: tuple[Fault, ...]) -> tuple[Fault, ...]:
        found = labels(value)
        doubled = next((label for label in found if found.count(label) > 1), None)
        if doubled is not None:
            raise PydanticCustomError(
                "labels", "two faults are called '{label}'; give one a name", {"label": doubled}
            )
        return value

    @model_validator(mode="after")
    def _limits_have_a_surface(self) -> Scenario:
        if self.road.file is not None and any(limit.surface for limit in self.limits):
            raise PydanticCustomError(
                "limit_surface", "a limit's surface belongs to a track; a road file has its own"
            )
        return self

    @property
    def variants(self) -> Variants:
        """What `vehicle.variants` stands for."""
        return self._variants

    @property
    def parameters(self) -> dict[str, Value]:
        """The vehicle's start values: the variants', overridden by `vehicle.parameters`."""
        return {**self._variants.parameters, **self.vehicle.parameters}

    def parameter_key(self, name: str) -> Key:
        """Return the path of what sets a parameter: its own field, or a variant's name."""
        if name in self.vehicle.parameters or name not in self._variants.origin:
            return ("vehicle", "parameters", name)
        return ("vehicle", "variants", self._variants.origin[name])

    @property
    def acting_faults(self) -> tuple[Acting, ...]:
        """What the entries of `faults` come to, by their labels and in their order."""
        return acting(self.faults, self._source)[0]

    @property
    def fault_files(self) -> dict[str, Path]:
        """The files that faults are read from, by the faults' labels."""
        named = zip(labels(self.faults), self.faults, strict=True)
        return {n: self.resolve(f.file) for n, f in named if isinstance(f, OspScenario)}

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
