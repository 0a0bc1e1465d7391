"""The controllers of a scenario; each makes one run."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.scenario.model import NAME_PATTERN, Model, with_unit
from cosim.scenario.sensor import EstimatorName, Sensor
from sensor.estimators import names


class OneRun(Model):
    """What every controller of a scenario may say of its run."""

    name: str | None = Field(default=None, pattern=NAME_PATTERN, description="name of the run")
    estimator: EstimatorName | None = Field(
        default=None,
        description="name of a shipped estimator that takes the scenario's sensor's place",
        json_schema_extra={"examples": list(names())},
    )
    network: str | None = Field(
        default=None,
        min_length=1,
        description="ONNX file, relative to the scenario, that takes the sensor's place",
    )

    @property
    def label(self) -> str:
        """Name of the run."""
        return label_of(self.model_dump())

    def sensor_of_run(self, shared: Sensor) -> Sensor:
        """Return the sensor of this run: the scenario's, or with this controller's estimator."""
        if self.estimator is None and self.network is None:
            return shared
        return Sensor(estimator=self.estimator, network=self.network, condition=shared.condition)

    @model_validator(mode="after")
    def _not_both(self) -> OneRun:
        if self.estimator is not None and self.network is not None:
            raise PydanticCustomError("sensor", "give either an estimator or a network")
        return self


class Passive(OneRun):
    """No controller: the dampers follow their passive curve."""

    kind: Literal["passive"]


class Fixed(OneRun):
    """All dampers at one command."""

    kind: Literal["fixed"]
    command: float = Field(ge=0, le=1, description="damper command, 0 soft, 1 hard")


class Law(OneRun):
    """A law that reads the suspension velocities."""

    feedback: Literal["truth", "estimate"] = Field(
        default="estimate", description="suspension velocity that the controller is given"
    )
    initial_command: float = Field(
        default=0.0,
        ge=0,
        le=1,
        description="damper command until the first valid estimate, 0 soft, 1 hard",
    )


class Skyhook(Law):
    """Continuous skyhook control of the four dampers."""

    kind: Literal["skyhook"]
    gain_ns_per_m: float | None = Field(
        default=None,
        gt=0,
        description="skyhook damping of one corner",
        json_schema_extra=with_unit("N s/m"),
    )


Controller = Annotated[Passive | Fixed | Skyhook, Field(discriminator="kind")]


def label_of(controller: dict[str, Any]) -> str:
    """Return the name of a run from the values of its controller, valid or not: the name it was
    given; else its kind, with the estimator that it names, or with what a law reads.
    """
    kind = controller.get("kind")
    default = controller.get("feedback", "estimate")
    if kind in ("passive", "fixed"):
        suffix = controller.get("estimator")
    else:
        suffix = default if default == "truth" else controller.get("estimator") or default
    return str(controller.get("name") or (f"{kind}_{suffix}" if suffix else kind))
