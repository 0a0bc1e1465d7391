"""A track from a user's OpenCRG file: its reference line, as the vehicle's own reader sees it."""

from __future__ import annotations

import ctypes
from importlib import resources
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.road.errors import RoadError
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
    library = _library()
    error = ctypes.create_string_buffer(1024)
    road = library.road_load(str(path).encode(), error, len(error))
    if not road:
        raise RoadError(error.value.decode("utf-8", "replace"))
    try:
        return _track(library, road, path.stem)
    finally:
        library.road_free(road)


def _library() -> ctypes.CDLL:
    path = Path(str(resources.files("cosim") / "fmus" / "road_crg.so"))
    if not path.is_file():
        raise RoadError(f"{path}: missing; build it with 'pip install .' or 'python fmu/build.py'")
    library = ctypes.CDLL(str(path))
    pointer, double = ctypes.c_void_p, ctypes.c_double
    out = ctypes.POINTER(double)
    library.road_load.restype = pointer
    library.road_load.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_size_t]
    library.road_free.argtypes = [pointer]
    library.road_free.restype = None
    library.road_range.argtypes = [pointer, out, out]
    library.road_range.restype = None
    library.road_point.argtypes = [pointer, double, double, out, out]
    library.road_point.restype = None
    library.road_elevation.argtypes = [pointer, double, double]
    library.road_elevation.restype = double
    library.road_curvature.argtypes = [pointer, double]
    library.road_curvature.restype = double
    return library


def _track(library: ctypes.CDLL, road: int, name: str) -> Track:
    first, last = ctypes.c_double(), ctypes.c_double()
    library.road_range(road, ctypes.byref(first), ctypes.byref(last))
    length = last.value - first.value - LEAD_IN - _FREE_END
    if length < 10.0:
        raise RoadError(
            f"{name}: the road is {last.value - first.value:g} m long; the car needs at least "
            f"{LEAD_IN + _FREE_END + 10.0:g} m to start and to finish on"
        )
    u = np.arange(first.value, last.value, DS)
    here, there = ctypes.c_double(), ctypes.c_double()
    line = np.empty((len(u), 4))
    for i, place in enumerate(u.tolist()):
        library.road_point(road, place, 0.0, ctypes.byref(here), ctypes.byref(there))
        height = library.road_elevation(road, place, 0.0)
        line[i] = here.value, there.value, height, library.road_curvature(road, place)
    x, y, z, curvature = line.T
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    flat = np.zeros_like(u)
    return Track(
        name, length, False, u - first.value - LEAD_IN, x.copy(), y.copy(), z.copy(), heading,
        curvature.copy(), _grade(z), flat, flat + _SPEED_LIMIT,
    )  # fmt: skip


def _grade(z: Floats) -> Floats:
    """Return dz/ds smoothed over 20 m: a driver feels hills, not stones."""
    width = round(20.0 / DS)
    slope = np.gradient(z, DS)
    padded = np.pad(slope, width // 2, mode="edge")
    return np.convolve(padded, np.ones(width) / width, mode="valid")[: len(z)]
