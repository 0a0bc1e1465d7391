"""Start values of the vehicle FMU: where it stands, on which road, with which parameters."""

from __future__ import annotations

from typing import Final

from cosim.course import Course
from cosim.errors import Problem
from cosim.fmi import Description, Value
from cosim.parameters import Setting
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
    mapped = scenario.vehicle.variables
    written = {mapped[q.name].name if q.name in mapped else q.variable for q in INPUT_QUANTITIES}
    setting = Setting(description, written, scenario.problem)
    problems = []
    if scenario.road.friction is not None and FRICTION not in setting.parameters:
        sentence = (
            f"'{description.path.name}' has no input '{FRICTION}' for the road's friction; "
            "leave road.friction out, and set the FMU's own under vehicle.parameters"
        )
        problems.append(scenario.problem(("road", "friction"), sentence))
    for name, value in scenario.parameters.items():
        key = scenario.parameter_key(name)
        if own and name in _TAKEN:
            problems.append(scenario.problem(key, f"'{name}' is set by {_TAKEN[name]}; use that"))
        elif (problem := setting.problem(key, name, value)) is not None:
            problems.append(problem)
    return problems
