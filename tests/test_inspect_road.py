"""`cosim inspect` on roads: the header as written, the road as met, the unevenness by ISO 8608."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.cli import main
from cosim.inspect.crg_header import read_header
from cosim.inspect.road import inspect
from cosim.inspect.roughness import LIMITS, N0, _spectrum, roughness
from cosim.road import Smooth, Surface, build_road, load_track
from cosim.road.iso8608 import ROUGHNESS, Iso8608
from cosim.road.reader import RoadFile

ASCII = """\
$CT
a hill made by hand
$
$ROAD_CRG ! the road
REFERENCE_LINE_START_U = 0.0
REFERENCE_LINE_END_U = 40.0
REFERENCE_LINE_INCREMENT = 1.0
LONG_SECTION_V_RIGHT = -2.0
LONG_SECTION_V_LEFT = 2.0
REFERENCE_LINE_START_PHI = 0.5D0
$
{mods}$KD_DEFINITION
#:LRFI
D:long section at v = -2.000,m
D:long section at v =  0.000,m
D:long section at v =  2.000,m
$
$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$$
{data}
"""


def ascii_road(path: Path, mods: str = "") -> Path:
    """A road whose left side lies 0.04 m above its right one, climbing 1 % along."""
    rows = ["".join(f"{0.01 * u + 0.01 * v:10.6f}" for v in (-2.0, 0.0, 2.0)) for u in range(41)]
    path.write_text(ASCII.format(mods=mods, data="\n".join(rows)))
    return path


def typed(*words: object) -> Result:
    return CliRunner().invoke(main, ["inspect", *map(str, words)])


def test_the_header_as_written(tmp_path: Path) -> None:
    header = read_header(ascii_road(tmp_path / "a.crg"))
    assert header.comment == ["a hill made by hand"]
    assert header.road["reference_line_increment"] == 1.0
    assert header.road["reference_line_start_phi"] == 0.5
    assert (header.format, header.columns) == ("LRFI", [-2.0, 0.0, 2.0])
    assert header.modifiers is None
    mods = "$ROAD_CRG_MODS\nSCALE_Z_GRID = 2 ! twice\n$\n"
    assert read_header(ascii_road(tmp_path / "b.crg", mods)).modifiers == {"scale_z_grid": 2.0}


def test_the_road_as_the_vehicle_meets_it(tmp_path: Path) -> None:
    d = inspect(ascii_road(tmp_path / "a.crg")).data
    assert (d["length_m"], d["width_m"], d["format"]) == (40.0, 4.0, "LRFI")
    assert d["elevation_m"] == pytest.approx([-0.02, 0.42], abs=1e-6)
    assert d["slope_percent"] == pytest.approx([1.0, 1.0], abs=1e-3)
    assert d["banking_percent"] == pytest.approx([1.0, 1.0], abs=1e-3)
    assert d["heading_deg"] == pytest.approx([0.0, 0.0], abs=1e-6)  # moved to heading 0
    assert d["least_radius_m"] is None
    assert d["end"]["x_m"] == pytest.approx(40.0)
    assert d["iso8608"] is None


def test_modifiers_are_applied_and_told(tmp_path: Path) -> None:
    mods = "$ROAD_CRG_MODS\nSCALE_Z_GRID = 2\nREFLINE_OFFSET_Z = 5\n$\n"
    path = ascii_road(tmp_path / "a.crg", mods)
    assert inspect(path).data["elevation_m"] == pytest.approx([4.96, 5.84], abs=1e-5)
    out = typed(path).stdout
    assert "scale_z_grid = 2, refline_offset_z = 5" in out
    still = ascii_road(tmp_path / "b.crg", "$ROAD_CRG_MODS\n$\n")
    assert "an empty block: the road stays where it is" in typed(still).stdout
    assert inspect(still).data["heading_deg"][0] == pytest.approx(math.degrees(0.5))
    assert "none given: the start is moved" in typed(ascii_road(tmp_path / "c.crg")).stdout


def test_what_the_reader_does_otherwise_is_told(tmp_path: Path) -> None:
    opts = "$ROAD_CRG_OPTS\nBORDER_MODE_U = 0\n$\n"
    path = ascii_road(tmp_path / "a.crg", opts)
    with RoadFile(path) as road:
        assert len(road.notes) == 1
        assert inspect(path).notes == road.notes
    assert "note: " in typed(path).stdout


def test_a_track_of_the_project(tmp_path: Path) -> None:
    track = load_track("hockenheim")
    d = inspect(build_road(track, Smooth(), tmp_path)).data
    assert d["length_m"] == pytest.approx(float(track.s[-1] - track.s[0]), abs=0.06)
    assert d["heading_deg"] == pytest.approx(
        [np.degrees(track.heading.min()), np.degrees(track.heading.max())], abs=1.0
    )
    assert d["least_radius_m"] == pytest.approx(1 / np.abs(track.curvature).max(), rel=0.03)
    banking = 100 * track.banking
    assert d["banking_percent"] == pytest.approx([banking.min(), banking.max()], abs=0.1)


@pytest.mark.parametrize("road_class", ["A", "C"])
def test_a_road_of_a_class_is_found_to_be_of_it(tmp_path: Path, road_class: str) -> None:
    surface: Surface = Iso8608(road_class, 3)
    path = build_road(load_track("straight", 400.0), surface, tmp_path)
    result = typed(path)
    assert result.exit_code == 0
    assert f"ISO 8608 class {road_class}" in result.stdout
    found = inspect(path).data["iso8608"]
    assert found["gd_n0_m3"] == pytest.approx(ROUGHNESS[road_class], rel=0.4)
    assert found["waviness"] == pytest.approx(2.0, abs=0.2)


def test_json_holds_every_fact(tmp_path: Path) -> None:
    d = json.loads(typed(ascii_road(tmp_path / "a.crg"), "--json").stdout)
    assert d["kind"] == "road"
    assert set(d) >= {"header", "modifiers", "elevation_m", "iso8608", "notes", "columns_m"}


def test_a_damaged_road_gets_the_readers_sentence(tmp_path: Path) -> None:
    path = ascii_road(tmp_path / "a.crg")
    path.write_text(path.read_text()[:400])
    result = typed(path)
    assert result.exit_code == 2
    assert str(path) in result.stderr


# ---------------------------------------------------------------- the spectrum


def sines(gd: float, waviness: float, length: float, step: float, seed: int) -> np.ndarray:
    """Elevations of a known spectrum: one sine of random phase to each 1/length."""
    n = np.arange(1, int(0.5 * length / step)) / length
    power = gd * (n / N0) ** -waviness
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(n))
    spectrum = np.zeros(int(length / step) // 2 + 1, complex)
    spectrum[1 : len(n) + 1] = np.sqrt(power / length / 2) * np.exp(1j * phase)
    return np.fft.irfft(spectrum * int(length / step), int(length / step))


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(sorted(LIMITS)), st.floats(1.7, 2.3), st.floats(300, 2000), st.integers(0, 99)
)
def test_known_spectra_are_recovered(road_class: str, w: float, length: float, seed: int) -> None:
    gd = LIMITS[road_class] / 2  # the geometric mean of a class
    lines = np.array([sines(gd, w, length, 0.1, seed + i) for i in range(2)])
    found = roughness(lines, 0.1)
    assert found is not None
    assert found.waviness == pytest.approx(w, abs=0.2)
    if abs(w - 2) < 0.1:
        assert found.road_class == road_class
        assert found.gd == pytest.approx(gd, rel=0.3)


@pytest.mark.parametrize("size", [256, 999])
def test_the_spectrum_is_that_of_scipy(size: int) -> None:
    from scipy.signal import welch

    lines = np.cumsum(np.random.default_rng(2).normal(size=(2, 4096)), axis=1)
    frequency, density = _spectrum(lines, 0.05, size)
    expected = welch(lines, 20.0, "hann", size, noverlap=size - size // 2, detrend="linear")
    np.testing.assert_allclose(frequency, expected[0])
    np.testing.assert_allclose(density[1:-1], expected[1].mean(axis=0)[1:-1], rtol=1e-9)


def test_no_class_without_unevenness_or_length() -> None:
    assert roughness(np.zeros((2, 5000)), 0.1) is None
    assert roughness(np.random.default_rng(0).normal(size=(2, 40)), 0.1) is None
    white = roughness(1e-3 * np.random.default_rng(0).normal(size=(2, 5000)), 0.1)
    assert white is not None
    assert white.waviness == pytest.approx(0.0, abs=0.2)


def test_hills_alone_are_no_class(tmp_path: Path) -> None:
    u = np.arange(0, 1000, 0.1)
    hills = 5 * np.sin(2 * np.pi * u / 300) + np.sin(2 * np.pi * u / 90)
    found = roughness(np.array([hills, hills]), 0.1)
    assert found is None or found.waviness > 3.5
