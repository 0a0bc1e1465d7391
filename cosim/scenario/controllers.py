"""The controllers of a scenario; each makes one run."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.control.add import CROSSOVER_HZ
from cosim.control.cautious import CAUTIOUS_GAIN, LEAST_DEVIATION
from cosim.control.hybrid import SKYHOOK_SHARE
from cosim.control.modal import ModalGains
from cosim.control.skyhook import HARD_COMMAND, SKYHOOK_GAIN
from cosim.scenario.latency import Latency
from cosim.scenario.model import NAME_PATTERN, Model, with_unit
from cosim.scenario.sensor import EstimatorName, Sensor
from cosim.scenario.vehicle import Parameter, Variable
from sensor.channels import PASSIVE_COMMAND
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
    fmu: str | None = Field(
        default=None,
        min_length=1,
        description="sensor FMU, relative to the scenario, that takes the sensor's place",
    )
    latency: Latency | None = Field(
        default=None, description="latencies of this run; the scenario's if not given"
    )

    @property
    def label(self) -> str:
        """Name of the run."""
        return label_of(self.model_dump())

    def sensor_of_run(self, shared: Sensor) -> Sensor:
        """Return the sensor of this run: the scenario's, or with this controller's estimator."""
        if not self._own:
            return shared
        return Sensor(
            estimator=self.estimator,
            network=self.network,
            fmu=self.fmu,
            condition=shared.condition,
        )

    @property
    def _own(self) -> list[str]:
        """What is given in the sensor's place."""
        return [given for given in (self.estimator, self.network, self.fmu) if given]

    def latency_of_run(self, shared: Latency) -> Latency:
        """Return the latencies of this run: its own, or the scenario's."""
        return shared if self.latency is None else self.latency

    @model_validator(mode="after")
    def _not_several(self) -> OneRun:
        if len(self._own) > 1:
            raise PydanticCustomError("sensor", "give either an estimator, a network or an FMU")
        return self


class Passive(OneRun):
    """No controller: the dampers follow their passive curve."""

    kind: Literal["passive"]


class Fixed(OneRun):
    """All dampers at one command."""

    kind: Literal["fixed"]
    command: float = Field(ge=0, le=1, description="damper command, 0 soft, 1 hard")


class Fallback(Model):
    """What the dampers do while the estimate is not valid or too uncertain."""

    command: float = Field(
        default=PASSIVE_COMMAND, ge=0, le=1, description="safe damper command, 0 soft, 1 hard"
    )
    largest_deviation_m_s: float | None = Field(
        default=None,
        gt=0,
        description="predicted deviation that is trusted, at each wheel; any if not given",
        json_schema_extra=with_unit("m/s"),
    )
    fade_s: float = Field(
        default=0.5,
        ge=0.01,
        description="from the law's command to the safe one, and back",
        json_schema_extra=with_unit("s"),
    )
    back_after_s: float = Field(
        default=1.0,
        ge=0,
        description="for how long the estimate must be trusted before the law is heard again",
        json_schema_extra=with_unit("s"),
    )


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
    fallback: Fallback | None = Field(
        default=None, description="a safe command while the estimate is not to be trusted"
    )

    @model_validator(mode="after")
    def _fallback_is_for_estimates(self) -> Law:
        if self.fallback is None:
            return self
        if self.feedback == "truth":
            sentence = "the truth is always valid; a fallback needs feedback: estimate"
            raise PydanticCustomError("fallback", sentence)
        if "initial_command" in self.model_fields_set:
            sentence = "the fallback's command is the initial one; leave initial_command out"
            raise PydanticCustomError("fallback", sentence)
        return self


def _gain(default: float) -> Any:
    return Field(
        default=default,
        gt=0,
        description="skyhook damping of one corner",
        json_schema_extra=with_unit("N s/m"),
    )


class Gained(Law):
    """A law with a damping of its own."""

    gain_ns_per_m: float = _gain(SKYHOOK_GAIN)


class Skyhook(Gained):
    """Continuous skyhook control of the four dampers."""

    kind: Literal["skyhook"]


class CautiousSkyhook(Gained):
    """Skyhook that weighs how uncertain the estimate is."""

    kind: Literal["cautious_skyhook"]
    gain_ns_per_m: float = _gain(CAUTIOUS_GAIN)
    least_deviation_m_s: float = Field(
        default=LEAST_DEVIATION,
        ge=0,
        description="of the suspension velocity's error, also where less is predicted",
        json_schema_extra=with_unit("m/s"),
    )


class TwoState(Law):
    """A law that knows soft and hard alone."""

    hard_command: float = Field(
        default=HARD_COMMAND, gt=0, le=1, description="damper command of the hard state, 1 hardest"
    )


class TwoStateSkyhook(TwoState):
    """Skyhook that switches between soft and hard."""

    kind: Literal["skyhook_two_state"]


class Add(TwoState):
    """Acceleration-driven damping."""

    kind: Literal["add"]


class SkyhookAdd(TwoState):
    """Skyhook below a frequency, acceleration-driven damping above it."""

    kind: Literal["sh_add"]
    crossover_hz: float = Field(
        default=CROSSOVER_HZ,
        gt=0,
        description="where the one law hands over to the other",
        json_schema_extra=with_unit("Hz"),
    )


class Hybrid(Gained):
    """Skyhook and groundhook, weighed against each other."""

    kind: Literal["hybrid"]
    skyhook_share: float = Field(
        default=SKYHOOK_SHARE, ge=0, le=1, description="1 skyhook alone, 0 groundhook alone"
    )


class ModalSkyhook(Law):
    """Skyhook on heave, roll and pitch of the body."""

    kind: Literal["modal_skyhook"]
    heave_ns_per_m: float = Field(
        default=ModalGains.heave,
        ge=0,
        json_schema_extra=with_unit("N s/m"),
        description="damping of heave against the sky",
    )
    roll_nms_per_rad: float = Field(
        default=ModalGains.roll,
        ge=0,
        json_schema_extra=with_unit("N m s/rad"),
        description="damping of roll against the sky",
    )
    pitch_nms_per_rad: float = Field(
        default=ModalGains.pitch,
        ge=0,
        json_schema_extra=with_unit("N m s/rad"),
        description="damping of pitch against the sky",
    )


class ControllerFmu(Law):
    """A controller that is an FMU."""

    kind: Literal["fmu"]
    file: str = Field(
        min_length=1, description="controller FMU, relative to the scenario (fmu is a sensor's)"
    )
    variables: dict[str, Variable] = Field(
        default_factory=dict, description="quantity to variable, for an FMU with other names"
    )
    parameters: dict[str, Parameter] = Field(
        default_factory=dict, description="start values by the FMU's names, in its units"
    )

    @model_validator(mode="before")
    @classmethod
    def _named_by_file(cls, data: Any) -> Any:
        if isinstance(data, dict) and "fmu" in data and "file" not in data:
            sentence = "the controller's FMU is named by file; fmu is a sensor FMU"
            raise PydanticCustomError("controller_fmu", sentence)
        return data


LawSettings = Skyhook | CautiousSkyhook | TwoStateSkyhook | Add | SkyhookAdd | Hybrid | ModalSkyhook
Controller = Annotated[Passive | Fixed | LawSettings | ControllerFmu, Field(discriminator="kind")]


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
