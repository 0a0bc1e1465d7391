"""What an OpenCRG file says of itself, and what the road is like for the vehicle that reads it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError
from cosim.inspect.crg_header import FORMATS, Header, read_header
from cosim.inspect.facts import Facts, number, size_of, span
from cosim.inspect.roughness import Roughness, roughness
from cosim.road.errors import RoadError
from cosim.road.reader import RoadFile

Floats = npt.NDArray[np.float64]

TRACK: Final = 0.8  # m from the reference line to where a wheel runs
_POINTS, _COLUMNS, _FINE = 4000, 15, 400_000  # places that are asked for
LAYOUT_WAVINESS: Final = 3.5  # a spectrum that falls so steeply is a layout's, no surface's
_SMOOTH: Final = 20.0  # m, over which slope and banking are averaged


def inspect(path: Path) -> Facts:
    """Return the facts of an OpenCRG file. Raises `InputError` with the reader's own sentence."""
    header = read_header(path)
    try:
        with RoadFile(path) as road:
            measured, rough = _measure(road, header)
            notes = road.notes
    except RoadError as error:
        raise InputError(str(error)) from None
    data = {
        "kind": "road",
        "file": str(path),
        "bytes": path.stat().st_size,
        "format": header.format,
        "comment": header.comment,
        "header": header.road,
        "modifiers": header.modifiers,
        "options": header.options,
        "channels": len(header.channels),
        "columns_m": header.columns,
        **measured,
        "iso8608": None if rough is None else {
            "class": rough.road_class, "gd_n0_m3": rough.gd, "waviness": rough.waviness,
            "from_cycles_per_m": rough.low, "to_cycles_per_m": rough.high,
        },
        "notes": notes,
    }  # fmt: skip
    headline = f"{path}: OpenCRG road, {measured['length_m']:.2f} m, {size_of(data['bytes'])}"
    facts = Facts(headline, data)
    _tables(facts, header, measured, rough)
    facts.notes += notes
    return facts


def _measure(road: RoadFile, header: Header) -> tuple[dict[str, Any], Roughness | None]:
    """Sample the road as a wheel would meet it."""
    length = road.last - road.first
    u = np.linspace(road.first, road.last, max(3, min(_POINTS, round(length / 0.5) + 1)))
    v = _across(header)
    surface = np.array([[road.elevation(a, b) for b in v] for a in u.tolist()])
    line = np.array([road.elevation(a, 0.0) for a in u.tolist()])
    x, y = np.array([road.point(a, 0.0) for a in u.tolist()]).T
    heading = np.unwrap(np.arctan2(np.diff(y), np.diff(x)))
    curvature = np.array([road.curvature(a) for a in u.tolist()])
    slope = _smooth(np.gradient(line, u), u)
    measured: dict[str, Any] = {
        "length_m": length,
        "u_m": [road.first, road.last],
        "width_m": float(v[-1] - v[0]) if len(v) > 1 else 0.0,
        "start": {"x_m": float(x[0]), "y_m": float(y[0]), "z_m": float(line[0]),
                  "heading_deg": float(np.degrees(heading[0]))},
        "end": {"x_m": float(x[-1]), "y_m": float(y[-1]), "z_m": float(line[-1]),
                "heading_deg": float(np.degrees(heading[-1]))},
        "elevation_m": [float(surface.min()), float(surface.max())],
        "heading_deg": _range(np.degrees(heading)),
        "slope_percent": _range(100.0 * slope),
        "least_radius_m": _radius(curvature),
    }  # fmt: skip
    if len(v) > 1:
        banking = np.polyfit(v, surface.T, 1)[0]
        measured["banking_percent"] = _range(100.0 * _smooth(banking, u))
    return measured, _roughness(road, header, v)


def _across(header: Header) -> Floats:
    """The columns of the file, thinned out, or its right and left edge."""
    if header.columns:
        places = np.array(sorted(header.columns))
    else:
        edges = [header.road.get(f"long_section_v_{side}") for side in ("right", "left")]
        places = np.array([edge for edge in edges if edge is not None] or [0.0])
        if len(places) == 2:
            places = np.linspace(places[0], places[1], _COLUMNS)
    if len(places) <= _COLUMNS:
        return places
    return np.asarray(places[np.linspace(0, len(places) - 1, _COLUMNS).round().astype(int)])


def _smooth(values: Floats, u: Floats) -> Floats:
    """Average over 20 m, without what reaches beyond the ends."""
    width = max(1, min(len(values), round(_SMOOTH / float(u[1] - u[0]))))
    return np.asarray(np.convolve(values, np.full(width, 1.0 / width), mode="valid"))


def _range(values: Floats) -> list[float]:
    return [float(values.min()), float(values.max())]


def _radius(curvature: Floats) -> float | None:
    most = float(np.abs(curvature).max())
    return 1.0 / most if most > 1e-5 else None


def _roughness(road: RoadFile, header: Header, v: Floats) -> Roughness | None:
    """Fit the spectrum along both wheel tracks, or the middle of a narrow road."""
    length = road.last - road.first
    step = min(header.road.get("reference_line_increment", 0.1), 0.2)
    step = max(step, 1e-3, length / _FINE)
    count = int(length / step)
    inside = [p for p in (-TRACK, TRACK) if v[0] <= p <= v[-1]] or [float(np.median(v))]
    if count < 16:
        return None
    places = (road.first + step * np.arange(count)).tolist()
    return roughness(np.array([[road.elevation(a, b) for a in places] for b in inside]), step)


# ---------------------------------------------------------------- tables


def _tables(
    facts: Facts, header: Header, measured: Mapping[str, Any], rough: Roughness | None
) -> None:
    step = header.road.get("reference_line_increment")
    shape = FORMATS.get(header.format, "of another file") + f" ({header.format or 'none'})"
    facts.pairs(
        "Header",
        [
            ("comment", "; ".join(header.comment[:3])),
            ("data", shape if not header.reference else f"in the file {header.reference}"),
            ("increment along", number(step, "m")),
            ("columns across", _columns(header)),
            ("channels", _channels(header)),
            ("modifiers", _modifiers(header)),
            ("options", ", ".join(f"{k} = {v:g}" for k, v in header.options.items())),
        ],
    )
    start, end = measured["start"], measured["end"]
    radius = measured["least_radius_m"]
    banking = measured.get("banking_percent")
    facts.pairs(
        "As the vehicle meets it",
        [
            ("length", f"{measured['length_m']:.3f} m, u from {measured['u_m'][0]:g} to "
             f"{measured['u_m'][1]:g} m"),
            ("width", number(measured["width_m"], "m")),
            ("start", _pose(start)),
            ("end", _pose(end)),
            ("elevation", span(measured["elevation_m"], "m")),
            ("heading", span(measured["heading_deg"], "deg")),
            ("least radius", number(radius, "m", 4) if radius else "straight"),
            ("slope, over 20 m", span(measured["slope_percent"], "%")),
            ("banking, over 20 m", span(banking, "%") if banking else ""),
            ("unevenness", _class(rough)),
        ],
    )  # fmt: skip


def _columns(header: Header) -> str:
    if not header.columns:
        edges = [header.road.get(f"long_section_v_{side}") for side in ("right", "left")]
        return f"{edges[0]} to {edges[1]} m" if None not in edges else ""
    gaps = np.diff(sorted(header.columns))
    apart = f", {gaps.min():.4g} to {gaps.max():.4g} m apart" if len(gaps) else ""
    if len(gaps) and np.ptp(gaps) < 1e-9:
        apart = f", {gaps[0]:.4g} m apart"
    return f"{len(header.columns)}, {span([min(header.columns), max(header.columns)], 'm')}{apart}"


def _channels(header: Header) -> str:
    own = [c.split(",")[0] for c in header.channels if "long section" not in c.lower()]
    return ", ".join(own)


def _modifiers(header: Header) -> str:
    if header.modifiers is None:
        return "none given: the start is moved to x = y = z = 0, heading 0"
    if not header.modifiers:
        return "an empty block: the road stays where it is"
    return ", ".join(f"{name} = {value:g}" for name, value in header.modifiers.items())


def _pose(pose: Mapping[str, float]) -> str:
    return (
        f"x {pose['x_m']:.2f} m, y {pose['y_m']:.2f} m, z {pose['z_m']:.2f} m, heading "
        f"{pose['heading_deg']:.2f} deg"
    )


def _class(rough: Roughness | None) -> str:
    if rough is None:
        return "not estimated: the road is flat, or too short for two octaves"
    if rough.waviness > LAYOUT_WAVINESS:
        return f"none but hills and banking (waviness {rough.waviness:.1f})"
    return (
        f"ISO 8608 class {rough.road_class}, Gd(n0) = {rough.gd * 1e6:.3g}e-6 m3, waviness "
        f"{rough.waviness:.2f}, fitted from {rough.low:.3g} to {rough.high:.3g} cycles/m"
    )
