"""The tracks: where they come from, and `load_track` to have one by name.

Hockenheim follows the arc list of the short circuit as CarMaker carries it; Heilbronn and the rural
road have no public layout and are made up to the known length, speeds and features.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from cosim.errors import did_you_mean
from cosim.road.elements import Arc, Element, Straight, close_circuit, parse_layout
from cosim.road.errors import RoadError
from cosim.road.track import Knots, Layout, Stop, Track, build_track
from cosim.road.winding import Bends, winding

_HOCKENHEIM = (
    "S200 R68/69 S220 R45/102 R150/35 L150/35 S200 L160/47 R160/47 R35/89 S60 R95/84 S220 L40/155 "
    "S60 L90/52 R100/27 S45 R50/77 S45 R69.525/119 S280 S17.3"
)
# The straight behind R35/89 and the last one take up about 1 m each to close the circuit.
_HOCKENHEIM_CLOSED_BY = (10, 22)
# Smooth steps to this grade and back, twice, make a dip of .45 m in 157 m.
_DIP_GRADE = 0.45 / (0.25 * 157.0)
_HOCKENHEIM_GRADE = (
    (2000.0, 0.0),
    (2039.25, -_DIP_GRADE),
    (2078.5, 0.0),
    (2117.75, _DIP_GRADE),
    (2157.0, 0.0),
)
_HOCKENHEIM_BANKING = (
    (1700.0, 0.0),
    (1728.0, -0.08),  # in the left-hand hairpin: the right side is the higher one
    (1795.0, -0.08),
    (1823.0, 0.0),
    (2150.0, 0.0),
    (2180.0, 0.08),  # in the last corner, a right-hand one
    (2275.0, 0.08),
    (2305.0, 0.0),
)

_RURAL_LENGTH = 1760.0
_LANE_LEFT, _LANE_RIGHT = "L180/8 R180/8", "R180/8 L180/8"  # 3.5 m to the side within 50 m
_AHEAD = "R25/40 L14/80 R25/40"  # roundabout of 14 m radius, right-hand traffic: second exit
_LEFT = "R25/40 L14/170 R25/40"  # third exit
_RIGHT = "R20/60 L14/30 R20/60"  # first exit
_RURAL = (
    f"S170 {_LANE_LEFT} S90 {_LANE_RIGHT} S90 {_AHEAD} S130 L100/90 S70 {_LEFT} S120 R30/120 S90 "
    f"L60/100 S70 {_RIGHT} S100 {_LANE_LEFT} S60"
)

_HEILBRONN_LENGTH = 5790.0
_HEILBRONN_SEED = 5790
_HEILBRONN_BENDS = Bends(radii=(22.0, 220.0), straights=(30.0, 140.0), begin=80.0, end=350.0)
_HEILBRONN_LIMITS = (
    (0.0, 50.0),
    (450.0, 70.0),
    (1500.0, 100.0),
    (2900.0, 70.0),
    (3600.0, 100.0),
    (5200.0, 50.0),
)
_HEILBRONN_STOPS = (
    Stop(430.0, 4.0),
    Stop(1490.0, 3.0),
    Stop(2890.0, 6.0),
    Stop(4100.0, 4.0),
    Stop(5250.0, 7.0),
)


def _hockenheim() -> Layout:
    """Short circuit, 2597 m, clockwise, with banked corners and a dip."""
    transition = 20.0
    elements = close_circuit(parse_layout(_HOCKENHEIM), transition, _HOCKENHEIM_CLOSED_BY)
    return Layout(
        name="hockenheim",
        elements=elements,
        transition=transition,
        closed=True,
        grade=_HOCKENHEIM_GRADE,
        banking=_HOCKENHEIM_BANKING,
        limits=((0.0, 120.0),),
    )


def _rural() -> Layout:
    """Country road, 1.76 km: roundabouts, lane changes, turns of constant radius; 75 km/h."""
    elements = parse_layout(_RURAL)
    rest = _RURAL_LENGTH - sum(e.length for e in elements)
    return Layout(
        name="rural",
        elements=(*elements[:-1], Straight(elements[-1].length + rest)),
        transition=8.0,
        limits=((0.0, 75.0),),
    )


def _heilbronn() -> Layout:
    """5.79 km through hills and villages: curves from 22 m on, grades to 6 %, five stops."""
    random = np.random.default_rng(_HEILBRONN_SEED)
    elements = winding(random, _HEILBRONN_LENGTH, _HEILBRONN_BENDS)
    return Layout(
        name="heilbronn",
        elements=elements,
        transition=20.0,
        grade=_hills(random, _HEILBRONN_LENGTH, steepest=0.06),
        banking=_superelevation(elements, 0.025),
        limits=_HEILBRONN_LIMITS,
        stops=_HEILBRONN_STOPS,
    )


def _hills(random: np.random.Generator, length: float, steepest: float) -> Knots:
    """Return grades, up and down in turn every 250 m or so, to `steepest`, level at both ends."""
    count = round(length / 250.0)
    places = np.linspace(60.0, length - 60.0, count) + random.uniform(-40.0, 40.0, count)
    grades = random.uniform(0.2, 1.0, count) * np.resize([1.0, -1.0], count)
    grades *= steepest / np.abs(grades).max()
    inner = zip(places[1:-1].tolist(), grades[1:-1].tolist(), strict=True)
    return ((0.0, 0.0), *inner, (length, 0.0))


def _superelevation(elements: tuple[Element, ...], slope: float) -> Knots:
    """Return a banking of `slope` towards the inside of every arc, reached around its ends."""
    ends = itertools.accumulate((e.length for e in elements), initial=0.0)
    knots: list[tuple[float, float]] = []
    for start, element in zip(ends, elements, strict=False):
        if isinstance(element, Arc):
            inside = -slope if element.left else slope
            end = start + element.length
            knots += [(start - 10.0, 0.0), (start + 10.0, inside)]
            knots += [(end - 10.0, inside), (end + 10.0, 0.0)]
    return tuple(knots)


def _straight() -> Layout:
    return Layout(name="straight", elements=(Straight(1000.0),), transition=0.0)


_LAYOUTS: dict[str, Callable[[], Layout]] = {
    "hockenheim": _hockenheim,
    "heilbronn": _heilbronn,
    "rural": _rural,
    "straight": _straight,
}
TRACK_NAMES = tuple(_LAYOUTS)


@lru_cache(maxsize=8)
def load_track(name: str, length: float | None = None) -> Track:
    """Return a track by name; `length` [m] is that of the straight one, which is 1 km without it.

    Raises `RoadError` for an unknown name, naming the nearest choice, and for a length that is not
    positive or given for another track.
    """
    if name not in _LAYOUTS:
        choices = ", ".join(TRACK_NAMES) + did_you_mean(name, TRACK_NAMES)
        raise RoadError(f"track '{name}' is not known; choose {choices}")
    layout = _LAYOUTS[name]()
    if length is not None:
        if name != "straight":
            raise RoadError(f"track '{name}' has its own length; only the straight takes one")
        if not 0.0 < length <= 20_000.0:
            raise RoadError(f"length_m is {length:g} m; it must be above 0 m and at most 20000 m")
        layout = replace(layout, elements=(Straight(float(length)),))
    return build_track(layout)
