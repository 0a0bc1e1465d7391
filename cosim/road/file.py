"""A track from a user's OpenCRG file: its reference line, as the vehicle's own reader sees it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.road.errors import RoadError
from cosim.road.reader import RoadFile
from cosim.road.track import DS, LEAD_IN, Track

Floats = npt.NDArray[np.float64]

_SPEED_LIMIT = 120 / 3.6  # m/s; a road file knows none
_FREE_END = 10.0  # road left over behind the finish [m]


def track_of_file(path: Path) -> Track:
    """Return the reference line of an OpenCRG file as a track.

    The car starts `LEAD_IN` behind the file's beginning, so that all of it stands on the road; that
    place is s = 0. The lap ends 10 m before the road does. No stops, and a speed limit of 120 km/h.
    Raises `RoadError` with the reader's own sentence, or if the road is too short to drive on.
    """
    with RoadFile(path) as road:
        return _track(road, path.stem)


def _track(road: RoadFile, name: str) -> Track:
    length = road.last - road.first - LEAD_IN - _FREE_END
    if length < 10.0:
        raise RoadError(
            f"{name}: the road is {road.last - road.first:g} m long; the car needs at least "
            f"{LEAD_IN + _FREE_END + 10.0:g} m to start and to finish on"
        )
    u = np.arange(road.first, road.last, DS)
    line = np.empty((len(u), 4))
    for i, place in enumerate(u.tolist()):
        line[i] = *road.point(place, 0.0), road.elevation(place, 0.0), road.curvature(place)
    x, y, z, curvature = line.T
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    flat = np.zeros_like(u)
    return Track(
        name, length, False, u - road.first - LEAD_IN, x.copy(), y.copy(), z.copy(), heading,
        curvature.copy(), _grade(z), flat, flat + _SPEED_LIMIT,
    )  # fmt: skip


def _grade(z: Floats) -> Floats:
    """Return dz/ds smoothed over 20 m: a driver feels hills, not stones."""
    width = round(20.0 / DS)
    slope = np.gradient(z, DS)
    padded = np.pad(slope, width // 2, mode="edge")
    return np.convolve(padded, np.ones(width) / width, mode="valid")[: len(z)]
