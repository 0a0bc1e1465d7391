"""Unevenness: spectra and coherence where wheels run, determinism (cosim.road.surface,
.iso8608).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from scipy import interpolate, signal

from cosim.road import Iso8608, RoadError, Smooth
from cosim.road.iso8608 import ROUGHNESS
from cosim.road.surface import finer_grid, finer_sections, on_columns
from cosim.road.track import DS

Floats = npt.NDArray[np.float64]

S = -20.0 + DS * np.arange(60_000)  # 3 km: columns where wheels run
LEFT, RIGHT = 0.778, -0.847
STEP = 0.043  # of the rides [m]: wheels meet any place between two cross sections
BANDS = np.geomspace(0.03, 5.0, 16)


def rides(surface: Iso8608, *places: float) -> list[Floats]:
    """What points at the lateral `places` meet, between the grid's points both ways [m]."""
    v = surface.columns(S)
    grid = surface.elevation(S, v).astype(float)
    at = np.arange(S[800], S[-5], STEP)  # behind the fade-in
    lines = []
    for place in places:
        j = int(np.searchsorted(v, place)) - 1
        share = (place - v[j]) / (v[j + 1] - v[j])
        lines.append(np.interp(at, S, grid[:, j] * (1.0 - share) + grid[:, j + 1] * share))
    return lines


def band_ratios(line: Floats, road_class: str) -> Floats:
    """Measured over nominal spectrum, in bands of about a third of an octave or more."""
    frequency, density = signal.welch(line, 1.0 / STEP, nperseg=8192, detrend="linear")
    nominal = ROUGHNESS[road_class] * (np.maximum(frequency, 1e-9) / 0.1) ** -2.0
    ratio = density / nominal
    bands = [(frequency >= a) & (frequency < b) for a, b in pairwise(BANDS)]
    return np.array([ratio[band].mean() for band in bands])


@pytest.mark.parametrize("road_class", ["A", "B", "C", "D"])
def test_the_spectrum_at_the_wheels_is_the_class(road_class: str) -> None:
    lines = rides(Iso8608(road_class, 1), LEFT, RIGHT, LEFT - 0.3, RIGHT + 0.12)
    ratios = np.array([band_ratios(line, road_class) for line in lines])
    assert np.all((ratios > 0.5) & (ratios < 2.0))  # the class's own limits
    assert ratios.mean(axis=0) == pytest.approx(1.0, abs=0.25)
    assert ratios.mean() == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("road_class", ["A", "B", "C", "D"])
def test_left_and_right_have_the_coherence_of_the_class(road_class: str) -> None:
    surface = Iso8608(road_class, 2)
    left, right = rides(surface, LEFT, RIGHT)
    frequency, squared = signal.coherence(left, right, 1.0 / STEP, nperseg=1024)
    used = (frequency > 0.05) & (frequency < 0.8)
    expected = surface.coherence(frequency[used], np.asarray(LEFT - RIGHT))
    assert np.sqrt(squared[used]) == pytest.approx(expected, abs=0.2)
    assert np.mean(np.sqrt(squared[used]) - expected) == pytest.approx(0.0, abs=0.05)


def test_classes_are_in_order() -> None:
    v = np.array([0.7, 0.8])
    rms = [float(np.std(Iso8608(c, 3).elevation(S, v))) for c in "ABCD"]
    doublings = np.diff(np.log2(rms))  # twice the height from class to class
    assert doublings == pytest.approx(1.0, abs=0.35)


def test_the_same_seed_gives_the_same_bytes_and_another_one_another_road() -> None:
    s = S[:4000]
    surface = Iso8608("B", 7)
    v = surface.columns(s)
    first = surface.elevation(s, v)
    assert first.tobytes() == Iso8608("B", 7).elevation(s, v).tobytes()
    assert not np.array_equal(first, Iso8608("B", 8).elevation(s, v))
    assert np.array_equal(first * 2.0**20, np.round(first * 2.0**20))


def test_the_start_is_even_and_the_roughness_fades_in() -> None:
    surface = Iso8608("D", 1)
    z = surface.elevation(S, surface.columns(S))
    assert not z[S <= 3.0].any()
    assert z[S > 13.0].std() > 0.01
    assert np.abs(np.diff(z[S < 8.0], axis=0)).max() < 0.02


def test_columns_are_dense_where_wheels_run() -> None:
    for s in (S, S[:8000]):
        v = Iso8608("A", 1).columns(s)
        assert v[0] <= -4.0
        assert v[-1] >= 4.0
        for wheel in (LEFT, RIGHT):
            near = (v[1:] > wheel - 0.35) & (v[:-1] < wheel + 0.35)
            assert np.diff(v)[near].max() <= 0.1 + 1e-9
    assert len(Iso8608("A", 1).columns(S[:8000])) == 91


def test_smooth_is_smooth() -> None:
    assert not Smooth().elevation(S, Smooth().columns(S)).any()


def test_more_columns_and_sections_are_the_same_surface() -> None:
    """Bilinear interpolation, as OpenCRG readers have it, against SciPy's."""
    s, surface = S[:600], Iso8608("C", 4)
    v = surface.columns(s)
    grid = surface.elevation(s, v)
    finer_s, finer_v = finer_sections(s), np.unique(np.append(v, [-0.612, 0.333, 0.777]))
    finer = on_columns(finer_grid(grid), v, finer_v)
    oracle = interpolate.RegularGridInterpolator((s, v), grid.astype(float))
    places = np.stack(np.meshgrid(finer_s, finer_v, indexing="ij"), axis=-1)
    assert finer == pytest.approx(oracle(places), abs=1e-8)


def test_bad_surfaces_are_refused() -> None:
    with pytest.raises(RoadError, match="road class 'F' is not one of A, B, C, D"):
        Iso8608("F", 1)
    with pytest.raises(RoadError, match="seed is -1"):
        Iso8608("A", -1)
