"""Writing OpenCRG files (ASAM OpenCRG 1.2), binary in single precision (KRBI).

Heading, slope and banking are channels of their own and the grid carries the roughness alone: an
elevation of 60 m in a single-precision grid would come in steps of 4 micrometres and shake the car.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from cosim.road.grid import RoadGrid
from cosim.road.surface import Floats
from cosim.road.track import Track

WRITER_VERSION = 2  # part of the cache's key: count up when the files change
_BLOCK = 80  # binary data is filled up to whole blocks of so many bytes


def write_crg(path: Path, track: Track, grid: RoadGrid) -> None:
    """Write a track with the elevations of `grid`, whose cross sections are the track's own or
    finer ones.

    u of the file is s of the track; x, y and z stay the track's own (an empty $ROAD_CRG_MODS keeps
    readers from moving the start to the origin). Heading and slope are those of the chords from one
    cross section to the next.
    """
    s = grid.s
    heading, banking = _between(track, s, track.heading), _between(track, s, track.banking)
    dx = np.diff(_along(track, s, track.x, np.cos(track.heading)))
    dy = np.diff(_along(track, s, track.y, np.sin(track.heading)))
    dz = np.diff(_along(track, s, track.z, track.grade))
    chord = np.arctan2(dy, dx)
    middle = 0.5 * (heading[1:] + heading[:-1])
    # the chord's direction, counted on as the track counts its heading
    phi = middle + np.remainder(chord - middle + np.pi, 2.0 * np.pi) - np.pi
    first = [float(heading[0])]  # the first entries of both channels are not used
    slope = np.concatenate(([0.0], dz / grid.step))
    channels = [np.concatenate((first, phi)), slope, banking, grid.elevation]
    data = np.column_stack(channels).astype(">f4")
    filler = np.full(-data.size % (_BLOCK // 4), np.nan, dtype=">f4")
    path.write_bytes(_header(track, grid).encode("ascii") + data.tobytes() + filler.tobytes())


def _between(track: Track, s: Floats, values: Floats) -> Floats:
    return values if s is track.s else np.interp(s, track.s, values)


def _along(track: Track, s: Floats, values: Floats, slopes: Floats) -> Floats:
    """Return a coordinate of the line [m] at `s`, between the track's points by its direction."""
    if s is track.s:
        return values
    return np.asarray(CubicHermiteSpline(track.s, values, slopes)(s), dtype=np.float64)


def _header(track: Track, grid: RoadGrid) -> str:
    v, step = grid.v, grid.step
    values = {
        "reference_line_start_u": track.s[0],
        "reference_line_end_u": track.s[-1],
        "reference_line_increment": step,
        "long_section_v_right": v[0],
        "long_section_v_left": v[-1],
        "reference_line_start_x": track.x[0],
        "reference_line_start_y": track.y[0],
        "reference_line_start_z": track.z[0],
        "reference_line_start_phi": track.heading[0],
        "reference_line_end_phi": track.heading[-1],
    }
    lines = [
        "$CT",
        f"{track.name}, {track.length:.2f} m",
        "$",
        "$ROAD_CRG",
        *(f"{name} = {float(value):.12g}" for name, value in values.items()),
        "$",
        "$ROAD_CRG_MODS ! empty: the road stays where it is",
        "$",
        "$KD_DEFINITION",
        "#:KRBI",
        f"U:reference line u,m,{float(track.s[0]):.12g},{step:.12g}",
        "D:reference line phi,rad",
        "D:reference line slope,m/m",
        "D:reference line banking,m/m",
        *(f"D:long section at v = {float(place):.3f},m" for place in v),
        "$",
        "$" * _BLOCK,
    ]
    return "\n".join(lines) + "\n"
