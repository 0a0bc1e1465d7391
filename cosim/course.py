"""The course of a scenario: the track and the road file that the wheels run on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cosim.errors import InputError, Problem
from cosim.road import (
    Bumps,
    Cobbles,
    Hump,
    Iso8608,
    Obstacle,
    Pothole,
    RoadError,
    Smooth,
    Surface,
    Track,
    build_road,
    load_track,
    track_of_file,
)
from cosim.road.circle import load_circle
from cosim.road.winding import load_winding
from cosim.scenario.obstacles import BumpRow, SpeedHump
from cosim.scenario.obstacles import Obstacle as ObstacleSettings
from cosim.scenario.schema import Scenario
from cosim.scenario.surface import CobbleSurface, IsoSurface


@dataclass(frozen=True)
class Course:
    """A track, and the OpenCRG file of its road."""

    track: Track
    file: Path


def course_of(
    scenario: Scenario, length: float | None = None, cache_dir: Path | None = None
) -> Course:
    """Return the scenario's course, its road built unless the cache has it.

    `length` [m] is that of a straight track whose length the scenario leaves open. Raises
    `InputError` with the place in the scenario for a file that is no OpenCRG road, and for
    obstacles that the road cannot carry.
    """
    road = scenario.road
    try:
        if road.file is not None:
            file = scenario.resolve(road.file).resolve()
            return Course(track_of_file(file), file)
        track = _track(scenario, length)
        obstacles = _obstacles(scenario, track.length)
        return Course(track, build_road(track, _surface(scenario), cache_dir, obstacles))
    except RoadError as error:
        key = ("road", "file") if road.file is not None else ("road",)
        raise InputError(scenario.problem(key, str(error))) from None


def _track(scenario: Scenario, length: float | None) -> Track:
    road = scenario.road
    if road.track == "winding":
        return load_winding(float(road.length_m or 0.0), _seed(scenario, road.seed))
    if road.track == "circle":
        angle = 270.0 if road.angle_deg is None else road.angle_deg
        return load_circle(float(road.radius_m or 0.0), angle, road.direction or "left")
    if road.track == "straight" and road.length_m is None:
        return load_track("straight", length)
    return load_track(str(road.track), road.length_m)


def _surface(scenario: Scenario) -> Surface:
    surface = scenario.road.surface
    if isinstance(surface, IsoSurface):
        return Iso8608(surface.road_class, _seed(scenario, surface.seed))
    if isinstance(surface, CobbleSurface):
        return Cobbles(
            _seed(scenario, surface.seed),
            surface.stone_length_m,
            surface.stone_width_m,
            surface.height_m,
            surface.crown_m,
            surface.road_class,
        )
    return Smooth()


def _seed(scenario: Scenario, own: int | None) -> int:
    return scenario.seed if own is None else own


def _obstacles(scenario: Scenario, length: float) -> list[Obstacle]:
    """Return the obstacles; raises `InputError` with every one that does not fit on the road."""
    obstacles: list[Obstacle] = []
    problems: list[Problem] = []
    for index, settings in enumerate(scenario.road.obstacles):
        key = ("road", "obstacles", index)
        try:
            obstacle = _obstacle(settings, length)
        except RoadError as error:
            problems.append(scenario.problem(key, str(error)))
            continue
        obstacles.append(obstacle)
        if obstacle.end > length:
            sentence = (
                f"the {obstacle.name} ends at {obstacle.end:g} m, behind the road's end at "
                f"{length:g} m"
            )
            problems.append(scenario.problem(key, sentence))
    if problems:
        raise InputError(problems)
    return obstacles


def _obstacle(settings: ObstacleSettings, road_length: float) -> Obstacle:
    if isinstance(settings, BumpRow):
        last = road_length if settings.to_m is None else settings.to_m
        return Bumps(
            settings.height_m, settings.length_m, settings.spacing_m, settings.from_m, last
        )
    if isinstance(settings, SpeedHump):
        return Hump(settings.at_m, settings.height_m, settings.length_m, settings.side)
    return Pothole(
        settings.at_m,
        settings.depth_m,
        settings.length_m,
        settings.width_m,
        settings.side,
        settings.edge_m,
        settings.offset_m,
    )
