"""The course of a scenario: the track that the driver follows and the road file that the wheels run
on.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cosim.errors import InputError
from cosim.road import (
    Bumps,
    Iso8608,
    RoadError,
    Smooth,
    Surface,
    Track,
    build_road,
    load_track,
    track_of_file,
)
from cosim.scenario.schema import Scenario
from cosim.scenario.surface import BumpSurface, IsoSurface


@dataclass(frozen=True)
class Course:
    """A track, and the OpenCRG file of its road."""

    track: Track
    file: Path


def course_of(scenario: Scenario, cache_dir: Path | None = None) -> Course:
    """Return the scenario's course, its road built unless the cache has it.

    Raises `InputError` with the place in the scenario for a file that is no OpenCRG road.
    """
    road = scenario.road
    try:
        if road.file is not None:
            file = scenario.resolve(road.file).resolve()
            return Course(track_of_file(file), file)
        track = load_track(str(road.track), road.length_m)
        return Course(track, build_road(track, _surface(scenario), cache_dir))
    except RoadError as error:
        key = ("road", "file") if road.file is not None else ("road",)
        raise InputError(scenario.problem(key, str(error))) from None


def _surface(scenario: Scenario) -> Surface:
    surface = scenario.road.surface
    if isinstance(surface, IsoSurface):
        seed = scenario.seed if surface.seed is None else surface.seed
        return Iso8608(surface.road_class, seed)
    if isinstance(surface, BumpSurface):
        return Bumps(surface.height_m, surface.length_m, surface.spacing_m)
    return Smooth()
