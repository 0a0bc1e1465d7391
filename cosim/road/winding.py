"""A winding road: straights and bends in turn, drawn at random."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from cosim.road.elements import Arc, Element, Straight
from cosim.road.errors import RoadError
from cosim.road.track import Layout, Track, build_track

# From the general direction, so that the road never meets itself [rad]
_WIDEST_HEADING: Final = math.radians(70.0)
SHORTEST: Final = 600.0  # [m]
_TRANSITION: Final = 30.0  # length of a clothoid where the elements leave room [m]
_LIMIT: Final = 120.0  # km/h


@dataclass(frozen=True)
class Bends:
    """From which the bends are drawn: `radii` each ratio as likely, `straights` between them [m].

    The road starts with a straight of `begin` [m]; the last takes up what is left once that is less
    than `end` [m].
    """

    radii: tuple[float, float]
    straights: tuple[float, float]
    begin: float
    end: float


_COUNTRY: Final = Bends(radii=(25.0, 400.0), straights=(15.0, 260.0), begin=60.0, end=450.0)


def winding(random: np.random.Generator, length: float, bends: Bends) -> tuple[Element, ...]:
    """Return straights and arcs in turn, `length` m in all, that keep to one general direction."""
    elements: list[Element] = [Straight(bends.begin)]
    heading, left_over = 0.0, length - bends.begin
    tightest, widest = (math.log(radius) for radius in bends.radii)
    while left_over > bends.end:
        radius = float(np.exp(random.uniform(tightest, widest)))
        angle = float(np.clip(random.uniform(0.4, 1.9), 30.0 / radius, 180.0 / radius))
        left = bool(random.random() < 0.5)
        if abs(heading + (angle if left else -angle)) > _WIDEST_HEADING:
            left = heading < 0.0
            angle = min(angle, _WIDEST_HEADING + abs(heading))
        heading += angle if left else -angle
        arc = Arc(round(radius, 1), math.degrees(angle), left)
        straight = Straight(round(float(random.uniform(*bends.straights)), 1))
        elements += [arc, straight]
        left_over -= arc.length + straight.length
    last = elements.pop()
    return (*elements, Straight(last.length + left_over))


@lru_cache(maxsize=8)
def load_winding(length: float, seed: int) -> Track:
    """Return a level road of `length` [m] with bends of 25 to 400 m, joined by clothoids; its speed
    limit is 120 km/h.

    Raises `RoadError` for a length below `SHORTEST`.
    """
    if length < SHORTEST:
        raise RoadError(f"the winding track needs {SHORTEST:g} m, not {length:g} m")
    elements = winding(np.random.default_rng(seed), length, _COUNTRY)
    return build_track(Layout("winding", elements, _TRANSITION, limits=((0.0, _LIMIT),)))
