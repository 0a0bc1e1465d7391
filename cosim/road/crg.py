"""Writing OpenCRG files (ASAM OpenCRG 1.2), binary in single precision (KRBI).

Heading, slope and banking are channels of their own and the grid carries the roughness alone: an
elevation of 60 m in a single-precision grid would come in steps of 4 micrometres and shake the car.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.road.track import DS, Track

WRITER_VERSION = 1  # part of the cache's key: count up when the files change
_BLOCK = 80  # binary data is filled up to whole blocks of so many bytes


def write_crg(
    path: Path, track: Track, v: npt.NDArray[np.float64], grid: npt.NDArray[np.float32]
) -> None:
    """Write a track with the elevation `grid` [m], shape (len(track.s), len(v)), at columns `v`.

    u of the file is s of the track; x, y and z stay the track's own (an empty $ROAD_CRG_MODS keeps
    readers from moving the start to the origin). Heading and slope are those of the chords from one
    cross section to the next.
    """
    dx, dy, dz = np.diff(track.x), np.diff(track.y), np.diff(track.z)
    chord = np.arctan2(dy, dx)
    middle = 0.5 * (track.heading[1:] + track.heading[:-1])
    # the chord's direction, counted on as the track counts its heading
    phi = middle + np.remainder(chord - middle + np.pi, 2.0 * np.pi) - np.pi
    first = [float(track.heading[0])]  # the first entries of both channels are not used
    data = np.column_stack(
        [np.concatenate((first, phi)), np.concatenate(([0.0], dz / DS)), track.banking, grid]
    ).astype(">f4")
    filler = np.full(-data.size % (_BLOCK // 4), np.nan, dtype=">f4")
    path.write_bytes(_header(track, v).encode("ascii") + data.tobytes() + filler.tobytes())


def _header(track: Track, v: npt.NDArray[np.float64]) -> str:
    values = {
        "reference_line_start_u": track.s[0],
        "reference_line_end_u": track.s[-1],
        "reference_line_increment": DS,
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
        f"U:reference line u,m,{float(track.s[0]):.12g},{DS:.12g}",
        "D:reference line phi,rad",
        "D:reference line slope,m/m",
        "D:reference line banking,m/m",
        *(f"D:long section at v = {float(place):.3f},m" for place in v),
        "$",
        "$" * _BLOCK,
    ]
    return "\n".join(lines) + "\n"
