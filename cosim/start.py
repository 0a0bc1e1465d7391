"""Start values of the vehicle FMU: where it stands, on which road, with which parameters."""

from __future__ import annotations

from typing import Final

from cosim.course import Course
from cosim.errors import Problem
from cosim.fmi import KINDS, Description, Value
from cosim.quantities import INPUT_QUANTITIES
from cosim.road import Track
from cosim.scenario.schema import Scenario

ROAD_FILE: Final = "Road.File"
OWN_ROAD: Final = "road.crg"  # in its resources: the built-in FMU's road where none is named
FRICTION: Final = "Road.Friction"  # an input of the built-in FMU: set once, it is held

# Set from the scenario's other fields; a second setting under parameters would contradict them.
_TAKEN: Final = {
    ROAD_FILE: "road", "Init.x": "road", "Init.y": "road", "Init.Yaw": "road",
    "Init.Velocity": "driver.speed_kmh", "Damp.Passive": "controllers",
    FRICTION: "road.friction",
}  # fmt: skip


def builtin_start(
    course: Course, line: Track, speed: float, passive: bool, friction: float | None
) -> dict[str, Value]:
    """Return the start values that put the package's own vehicle at s = 0 of the line that is
    driven, rolling at `speed` [m/s]; `friction` scales the tyres', None leaves it as it is.
    """
    pose = line.pose(0.0)
    start: dict[str, Value] = {
        "Init.x": pose.x,
        "Init.y": pose.y,
        "Init.Yaw": pose.heading,
        "Init.Velocity": speed,
        "Damp.Passive": passive,
        ROAD_FILE: str(course.file),
    }
    return start if friction is None else start | {FRICTION: friction}


def checked_parameters(scenario: Scenario, description: Description) -> list[Problem]:
    """Return what is wrong with the vehicle's parameters, those of its variants too: names, types,
    ranges, settings made elsewhere; and a friction that the FMU cannot take.
    """
    own = scenario.vehicle.fmu == "builtin"
    parameters = {
        name: v
        for name, v in description.variables.items()
        if v.causality in ("parameter", "input")
    }
    mapped = scenario.vehicle.variables
    written = {mapped[q.name].name if q.name in mapped else q.variable for q in INPUT_QUANTITIES}
    problems = []
    if scenario.road.friction is not None and FRICTION not in parameters:
        sentence = (
            f"'{description.path.name}' has no input '{FRICTION}' for the road's friction; "
            "leave road.friction out, and set the FMU's own under vehicle.parameters"
        )
        problems.append(scenario.problem(("road", "friction"), sentence))
    for name, value in scenario.parameters.items():
        key = scenario.parameter_key(name)
        variable = parameters.get(name)
        if variable is None:
            sentence = f"'{description.path.name}' has no parameter '{name}'"
            problems.append(scenario.problem(key, sentence, tuple(parameters), name))
        elif name in written:
            sentence = f"'{name}' is written by the loop at every step; it is no parameter"
            problems.append(scenario.problem(key, sentence))
        elif own and name in _TAKEN:
            problems.append(scenario.problem(key, f"'{name}' is set by {_TAKEN[name]}; use that"))
        elif (unfit := _unfit(variable, value, description.unit_of(name))) is not None:
            problems.append(scenario.problem(key, f"{name} {unfit}"))
    return problems


def _unfit(variable: object, value: Value, unit: str | None) -> str | None:
    """Say why a value does not fit a variable, or None."""
    declared = str(getattr(variable, "type"))  # noqa: B009 - FMPy's variables have no types for mypy
    if getattr(variable, "dimensions", None):
        return "is an array; only single values can be set"
    kind = KINDS.get(declared)
    if kind is None:
        return f"is of type {declared}; only real, whole, Boolean and text parameters can be set"
    wants = {"Boolean": (bool, "true or false"), "String": (str, "text")}.get(kind)
    if wants is not None:
        return None if isinstance(value, wants[0]) else f"= {_shown(value)} must be {wants[1]}"
    if isinstance(value, bool | str):
        return f"= {_shown(value)} must be a number"
    if kind == "Integer" and value != int(value):
        return f"= {value:g} must be a whole number"
    low, high = getattr(variable, "min", None), getattr(variable, "max", None)
    shown = f" {unit}" if unit and unit != "1" else ""
    if low is not None and value < float(low):
        return f"= {value:g}{shown} is below its least value {float(low):g}{shown}"
    if high is not None and value > float(high):
        return f"= {value:g}{shown} is above its greatest value {float(high):g}{shown}"
    return None


def _shown(value: Value) -> str:
    """Return a value as YAML writes it."""
    return str(value).lower() if isinstance(value, bool) else repr(value)
