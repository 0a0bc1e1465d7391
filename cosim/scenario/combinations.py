"""What the parts of a scenario ask of each other, each right by itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from cosim.errors import Problem
from cosim.scenario.manoeuvre import (
    Accelerate,
    Brake,
    ConstantRadius,
    ConstantSpeed,
    DoubleLaneChange,
    Manoeuvre,
    Mix,
    SineWithDwell,
    Slalom,
    StepSteer,
)
from cosim.scenario.schema import Scenario

MOST_LATERAL: Final = 10.0  # m/s2; more than the tyres of a road car hold
LEAST_STEER_KMH: Final = 15.0  # below, a car hardly answers with its yaw rate alone

_NAMES: Final[dict[type, str]] = {
    ConstantSpeed: "driving at constant speed",
    ConstantRadius: "driving at constant radius",
    DoubleLaneChange: "the double lane change",
    Slalom: "the slalom",
    SineWithDwell: "the sine with dwell",
    StepSteer: "the step steer",
    Brake: "braking",
    Accelerate: "accelerating",
    Mix: "the mix",
}
_TRACKS: Final[dict[type, tuple[str, ...]]] = {
    ConstantRadius: ("circle",),
    Mix: ("winding", "straight"),
    **dict.fromkeys((DoubleLaneChange, Slalom, SineWithDwell, StepSteer), ("straight",)),
}


def combination_problems(scenario: Scenario) -> Iterator[Problem]:
    """Yield what does not go together in a scenario whose parts are valid."""
    manoeuvre, road = scenario.manoeuvre, scenario.road
    endless = road.track == "straight" and road.length_m is None
    if endless and (manoeuvre is None or isinstance(manoeuvre, ConstantSpeed | Mix)):
        yield scenario.problem(("road",), "the straight track needs its length_m")
    if manoeuvre is None:
        return
    name = _NAMES[type(manoeuvre)]
    tracks = _TRACKS.get(type(manoeuvre))
    if tracks is not None and road.track not in tracks:
        given = f"the {road.track} track" if road.track else "a road file"
        sentence = f"{name} needs the {' or the '.join(tracks)} track, not {given}"
        yield scenario.problem(("manoeuvre", "kind"), sentence)
    elif isinstance(manoeuvre, Mix):
        return
    elif scenario.driver.speed_kmh is None:
        yield scenario.problem(("manoeuvre",), f"{name} needs driver.speed_kmh")
    else:
        yield from _speed_problems(scenario, manoeuvre, scenario.driver.speed_kmh)


def too_fast(name: str, kmh: float, lateral: float, friction: float | None) -> str | None:
    """Return a sentence where a manoeuvre's path takes more lateral acceleration [m/s2] than tyres
    hold on a road of this friction, else None.
    """
    most = MOST_LATERAL * (1.0 if friction is None else friction)
    if lateral <= most:
        return None
    where = "" if friction is None else f" at a friction of {friction:g}"
    return (
        f"{name} at {kmh:g} km/h takes {lateral:.1f} m/s2 of lateral acceleration; the tyres of a "
        f"road car hold less than {most:g} m/s2{where}"
    )


def _speed_problems(scenario: Scenario, manoeuvre: Manoeuvre, kmh: float) -> Iterator[Problem]:
    key = ("driver", "speed_kmh")
    lateral = _lateral(scenario, manoeuvre, kmh / 3.6)
    sentence = too_fast(_NAMES[type(manoeuvre)], kmh, lateral, scenario.road.friction)
    if sentence is not None:
        yield scenario.problem(key, sentence)
    if isinstance(manoeuvre, SineWithDwell | StepSteer) and kmh < LEAST_STEER_KMH:
        sentence = f"{_NAMES[type(manoeuvre)]} needs at least {LEAST_STEER_KMH:g} km/h"
        yield scenario.problem(key, f"{sentence}, not {kmh:g} km/h")
    if isinstance(manoeuvre, Brake) and manoeuvre.to_kmh >= kmh:
        sentence = f"braking to {manoeuvre.to_kmh:g} km/h must begin faster than that, not at"
        yield scenario.problem(("manoeuvre", "to_kmh"), f"{sentence} {kmh:g} km/h")
    if isinstance(manoeuvre, Accelerate) and manoeuvre.to_kmh <= kmh:
        sentence = f"accelerating to {manoeuvre.to_kmh:g} km/h must begin slower than that, not at"
        yield scenario.problem(("manoeuvre", "to_kmh"), f"{sentence} {kmh:g} km/h")


def _lateral(scenario: Scenario, manoeuvre: Manoeuvre, speed: float) -> float:
    """Return the lateral acceleration [m/s2] that the path asks for, 0 where it does not tell."""
    if isinstance(manoeuvre, ConstantRadius) and scenario.road.radius_m is not None:
        return speed * speed / scenario.road.radius_m
    if isinstance(manoeuvre, Slalom):
        from cosim.manoeuvre.slalom import bend_at_cones  # which reads scenarios itself

        width = scenario.vehicle.outline.width_m
        return speed * speed * bend_at_cones(manoeuvre.spacing_m, manoeuvre.clearance_m, width)
    return 0.0
