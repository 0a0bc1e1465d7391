"""The vehicle's OpenCRG reader as a shared library, and OpenCRG files made by hand."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

SOURCES = Path(__file__).parents[1] / "fmu" / "vehicle"
FLAGS = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wno-psabi", "-O2"]


def compile_reader(target: Path, *flags: str, program: Path | None = None) -> Path:
    """Compile the reader: a shared library, or a program with `program` as its main file."""
    sources = sorted(str(p) for p in SOURCES.glob("road_crg*.c"))
    kind = ["-shared", "-fPIC"] if program is None else [str(program)]
    command = ["cc", *FLAGS, *flags, f"-I{SOURCES}", *kind, *sources, "-o", str(target), "-lm"]
    subprocess.run(command, check=True)
    return target


class _Position(ctypes.Structure):
    _fields_ = [(name, ctypes.c_double) for name in ("u", "v", "heading", "tx", "ty", "stretch")]


class Located(NamedTuple):
    u: float
    v: float
    heading: float
    stretch: float
    hint: int


class Reader:
    """One loaded road; `Reader.open` raises ValueError with the reader's own sentence."""

    def __init__(self, library: ctypes.CDLL, handle: int) -> None:
        self._lib, self._handle = library, handle

    @classmethod
    def open(cls, library: ctypes.CDLL, path: Path) -> Reader:
        error = ctypes.create_string_buffer(1024)
        handle = library.road_load(bytes(path), error, len(error))
        if not handle:
            raise ValueError(error.value.decode("ascii"))
        return cls(library, handle)

    def __enter__(self) -> Reader:
        return self

    def __exit__(self, *_: object) -> None:
        self._lib.road_free(self._handle)

    def notes(self) -> str:
        return str(self._lib.road_notes(self._handle).decode())

    def range(self) -> tuple[float, float]:
        first, last = ctypes.c_double(), ctypes.c_double()
        self._lib.road_range(self._handle, ctypes.byref(first), ctypes.byref(last))
        return first.value, last.value

    def elevation(self, u: float, v: float) -> float:
        return float(self._lib.road_elevation(self._handle, u, v))

    def curvature(self, u: float) -> float:
        return float(self._lib.road_curvature(self._handle, u))

    def point(self, u: float, v: float) -> tuple[float, float]:
        x, y = ctypes.c_double(), ctypes.c_double()
        self._lib.road_point(self._handle, u, v, ctypes.byref(x), ctypes.byref(y))
        return x.value, y.value

    def locate(self, x: float, y: float, hint: int = -1) -> Located:
        place, found = _Position(), ctypes.c_int(hint)
        self._lib.road_locate(self._handle, x, y, ctypes.byref(found), ctypes.byref(place))
        return Located(place.u, place.v, place.heading, place.stretch, found.value)


def load_library(path: Path) -> ctypes.CDLL:
    library = ctypes.CDLL(str(path))
    pointer, number = ctypes.c_void_p, ctypes.c_double
    library.road_load.restype = pointer
    library.road_load.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_size_t]
    library.road_free.argtypes = [pointer]
    library.road_notes.restype = ctypes.c_char_p
    library.road_notes.argtypes = [pointer]
    library.road_range.argtypes = [pointer, pointer, pointer]
    library.road_elevation.restype = number
    library.road_elevation.argtypes = [pointer, number, number]
    library.road_curvature.restype = number
    library.road_curvature.argtypes = [pointer, number]
    library.road_point.argtypes = [pointer, number, number, pointer, pointer]
    library.road_locate.argtypes = [pointer, number, number, pointer, pointer]
    return library


class CrgText(NamedTuple):
    """An OpenCRG file in pieces: keywords, channel definitions, data of shape (rows, channels)."""

    road: str
    channels: Sequence[str]
    data: npt.NDArray[np.float64]
    mods: str | None = None
    opts: str | None = None
    form: str = "LDFI"

    def write(self, path: Path) -> Path:
        blocks = ["$CT", "made by hand", "$", "$ROAD_CRG", self.road.strip(), "$"]
        if self.mods is not None:
            blocks += ["$ROAD_CRG_MODS", self.mods.strip(), "$"]
        if self.opts is not None:
            blocks += ["$ROAD_CRG_OPTS ! of the evaluation", self.opts.strip(), "$"]
        blocks += [
            "$KD_DEFINITION",
            f"#:{self.form}",
            *(f"D:{c}" for c in self.channels),
            "$",
            "$" * 80,
        ]
        header = "\n".join(blocks) + "\n"
        path.write_bytes(header.encode() + self._data())
        return path

    def _data(self) -> bytes:
        if self.form in ("KRBI", "KDBI"):
            kind = ">f4" if self.form == "KRBI" else ">f8"
            filler = np.full(-self.data.size % (80 // int(kind[2])), np.nan, dtype=kind)
            return self.data.astype(kind).tobytes() + filler.tobytes()
        width, digits = (20, 12) if self.form == "LDFI" else (10, 6)
        lines = []
        for record in self.data:
            fields = ["*" * width if np.isnan(q) else f"{q:{width}.{digits}f}" for q in record]
            per_line = 80 // width
            lines += ["".join(fields[i : i + per_line]) for i in range(0, len(fields), per_line)]
        return ("\n".join(lines) + "\n").encode()


def winding_road(**changes: object) -> CrgText:
    """A curved, banked, graded, uneven road of 60 cross sections with unevenly spaced columns."""
    count, du = 60, 0.25
    u = du * np.arange(count)
    phi = 0.5 + 0.08 * np.sin(u / 3.0) + 0.03 * u
    columns = (-3.0, -2.0, -1.2, -1.0, -0.2, 0.5, 2.0, 3.1)
    grid = np.random.default_rng(5).normal(0.0, 0.02, (count, len(columns)))
    data = np.column_stack([phi, 0.05 * np.sin(u / 5.0), 0.04 * np.cos(u / 4.0), grid])
    road = f"""reference_line_start_u = 10 ! m
* a comment
REFERENCE_LINE_END_U = {10 + u[-1]}
reference_line_increment = {du}
reference_line_start_x = 100
reference_line_start_y = -50
reference_line_start_z = 7
reference_line_start_phi = {phi[1]}
reference_line_end_phi = {phi[-1]}
long_section_v_right = -3
long_section_v_left = 3.1"""
    channels = ["reference line phi,rad", "reference line slope,m/m", "reference line banking,m/m"]
    channels += [f"long section at v = {v:.3f},m" for v in columns]
    return CrgText(road, channels, data)._replace(**changes)
