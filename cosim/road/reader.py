"""The vehicle's own OpenCRG reader (fmu/vehicle/road_crg.h), called from Python."""

from __future__ import annotations

import ctypes
from functools import cache
from importlib import resources
from pathlib import Path

from cosim.road.errors import RoadError


class RoadFile:
    """An OpenCRG file as the wheels meet it; a context manager.

    u runs along the reference line, v to its left [m]; outside the grid the edge goes on. Raises
    `RoadError` with the reader's own sentence for a file that it cannot read.
    """

    def __init__(self, path: Path) -> None:
        self._library = _library()
        error = ctypes.create_string_buffer(1024)
        self._road = self._library.road_load(str(path).encode(), error, len(error))
        if not self._road:
            raise RoadError(error.value.decode("utf-8", "replace"))
        first, last = ctypes.c_double(), ctypes.c_double()
        self._library.road_range(self._road, ctypes.byref(first), ctypes.byref(last))
        self.first, self.last = first.value, last.value
        self._x, self._y = ctypes.c_double(), ctypes.c_double()

    def __enter__(self) -> RoadFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._library.road_free(self._road)
        self._road = None

    @property
    def notes(self) -> list[str]:
        """What the file asks for and this reader does otherwise, one sentence each."""
        text = self._library.road_notes(self._road) or b""
        return [line for line in text.decode("utf-8", "replace").splitlines() if line]

    def point(self, u: float, v: float) -> tuple[float, float]:
        """Return the inertial x and y of a place [m]."""
        self._library.road_point(self._road, u, v, ctypes.byref(self._x), ctypes.byref(self._y))
        return self._x.value, self._y.value

    def elevation(self, u: float, v: float) -> float:
        """Return the inertial z of the surface [m]."""
        return float(self._library.road_elevation(self._road, u, v))

    def curvature(self, u: float) -> float:
        """Return the curvature of the reference line, positive to the left [1/m]."""
        return float(self._library.road_curvature(self._road, u))


@cache
def _library() -> ctypes.CDLL:
    path = Path(str(resources.files("cosim") / "fmus" / "road_crg.so"))
    if not path.is_file():
        raise RoadError(f"{path}: missing; build it with 'pip install .' or 'python fmu/build.py'")
    library = ctypes.CDLL(str(path))
    pointer, double = ctypes.c_void_p, ctypes.c_double
    out = ctypes.POINTER(double)
    signatures = {
        "road_load": (pointer, [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_size_t]),
        "road_free": (None, [pointer]),
        "road_notes": (ctypes.c_char_p, [pointer]),
        "road_range": (None, [pointer, out, out]),
        "road_point": (None, [pointer, double, double, out, out]),
        "road_elevation": (double, [pointer, double, double]),
        "road_curvature": (double, [pointer, double]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library
