"""Obstacles: shapes, places, limits of the grid, read back by ASAM's reader (cosim.road.obstacles,
.grid).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycrg
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from cosim.road import (
    Bumps,
    Cobbles,
    Hump,
    Iso8608,
    Obstacle,
    Pothole,
    RoadError,
    Smooth,
    build_road,
    load_track,
)
from cosim.road.grid import road_grid
from cosim.road.obstacles import SHORTEST_SLOPE, SHORTEST_WAVE
from cosim.road.surface import FINE_STEP, Surface
from cosim.road.track import DS

S = -20.0 + DS * np.arange(4000)
TRACK = load_track("straight", 100.0)
WHEELS = (0.778 - 0.06, 0.778 + 0.06, -0.847 - 0.06, -0.847 + 0.06)  # the patches' lines


def heights(folder: Path, surface: Surface, obstacles: list[Obstacle], v: float) -> np.ndarray:
    """Elevations every 5 mm along a line, by ASAM's reader [m]."""
    path = build_road(TRACK, surface, folder, obstacles)
    with pycrg.DataSet.open(path, check=True) as data:
        point = data.create_contact_point()
        return np.array([point.uv_to_z(u, v) for u in PLACES.tolist()])


PLACES = np.arange(25.0, 50.0, 0.005)


@pytest.mark.parametrize("surface", [Smooth(), Iso8608("B", 3), Cobbles(2)], ids=lambda s: s.label)
def test_a_pothole_is_found_on_every_surface(tmp_path: Path, surface: Surface) -> None:
    """What the hole adds is a trapezoid of full depth, as long and as steep as asked."""
    hole = Pothole(place=40.0, depth=0.06, length=0.5, width=0.6, edge=0.1)
    ramp = np.interp(PLACES, [40.0, 40.1, 40.4, 40.5], [0.0, -0.06, -0.06, 0.0])
    for v in WHEELS:
        added = heights(tmp_path, surface, [hole], v) - heights(tmp_path, surface, [], v)
        assert added == pytest.approx(ramp, abs=1e-6)


@pytest.mark.parametrize("place", [40.0, 40.006, 40.0125, 40.02])
def test_a_pothole_between_cross_sections_keeps_its_depth_and_its_edges(
    tmp_path: Path, place: float
) -> None:
    hole = Pothole(place, depth=0.06, length=0.2 + SHORTEST_SLOPE, width=0.5, edge=0.1)
    added = heights(tmp_path, Smooth(), [hole], 0.8)
    end = place + hole.length
    ramp = np.interp(PLACES, [place, place + 0.1, end - 0.1, end], [0.0, -0.06, -0.06, 0.0])
    assert added.min() == pytest.approx(-0.06, abs=1e-6)
    # at a corner the grid's straight lines cut off a quarter of a step at most
    assert np.abs(added - ramp).max() <= 0.06 / 0.1 * FINE_STEP / 4 + 1e-6


@pytest.mark.parametrize(("side", "left", "right"), [("left", 1, 0), ("right", 0, 1)])
def test_one_side_leaves_the_other_alone(tmp_path: Path, side: str, left: int, right: int) -> None:
    for obstacle in (
        Pothole(30.0, 0.05, 0.5, 0.5, side),  # type: ignore[arg-type]
        Hump(30.0, -0.05, 1.0, side),  # type: ignore[arg-type]
    ):
        found = [heights(tmp_path, Smooth(), [obstacle], v).min() for v in (0.778, -0.847)]
        assert found == pytest.approx([-0.05 * left, -0.05 * right], abs=1e-6)


@given(
    place=st.floats(5.0, 60.0),
    length=st.floats(SHORTEST_WAVE, 8.0),
    height=st.floats(0.005, 0.2),
)
@settings(max_examples=50, deadline=None)
def test_a_hump_is_never_lost_between_cross_sections(
    place: float, length: float, height: float
) -> None:
    """Its top is met to within the stated 4 %, and its area to within 2 %."""
    hump = Hump(place, height, length)
    grid = road_grid(TRACK.s, Smooth(), [hump])
    line = grid.elevation[:, -1].astype(float)
    assert 0.96 * height <= line.max() <= height * (1 + 1e-6)
    assert np.trapezoid(line, grid.s) == pytest.approx(0.5 * height * length, rel=0.02)
    outside = (grid.s < place) | (grid.s > place + length)
    assert not line[outside].any()


def test_a_hump_spans_the_road(tmp_path: Path) -> None:
    found = [heights(tmp_path, Smooth(), [Hump(30.0, 0.08, 3.6)], v).max() for v in (-4.4, 0, 2)]
    assert found == pytest.approx([0.08] * 3, rel=1e-3)


def test_bumps_alternate_from_side_to_side() -> None:
    grid = road_grid(S, Smooth(), [Bumps(height=0.03, length=0.5, spacing=4.0)])
    z, v, s = grid.elevation, grid.v, grid.s
    left, right = z[:, np.argmin(np.abs(v - 0.3))], z[:, np.argmin(np.abs(v + 0.3))]
    assert left.max() == pytest.approx(0.03, rel=1e-3)
    assert not (left * right).any()
    tops = s[signal.find_peaks(left)[0]]
    assert np.diff(tops) == pytest.approx(4.0, abs=FINE_STEP)
    assert s[signal.find_peaks(right)[0]][0] - tops[0] == pytest.approx(2.0, abs=FINE_STEP)
    assert not z[s < 15.0].any()


def test_bumps_are_whole_up_to_their_end() -> None:
    bumps = Bumps(height=0.03, length=0.5, spacing=4.0, first=20.0, last=30.4)
    line = bumps.elevation(S, np.array([1.0, -1.0]))
    assert len(signal.find_peaks(line[:, 0])[0]) == 3  # from 20, 24 and 28 m
    assert len(signal.find_peaks(line[:, 1])[0]) == 2  # from 22 and 26 m; 30 m would not fit
    assert not line[S > 28.5].any()


def test_obstacles_add_up() -> None:
    both = road_grid(S, Smooth(), [Hump(30.0, 0.05, 1.0), Pothole(30.2, 0.03, 0.4, 0.5)])
    j = int(np.argmin(np.abs(both.v - 0.8)))
    i = int(np.argmin(np.abs(both.s - 30.4)))
    single = Hump(30.0, 0.05, 1.0).elevation(both.s, both.v)
    assert both.elevation[i, j] == pytest.approx(single[i, j] - 0.03, abs=1e-6)


def test_roads_with_obstacles_are_cached_apart(tmp_path: Path) -> None:
    lists: list[list[Obstacle]] = [
        [], [Hump(30.0, 0.05, 1.0)], [Hump(30.0, 0.06, 1.0)], [Pothole(30.0, 0.05, 0.5, 0.5)],
    ]  # fmt: skip
    paths = [build_road(TRACK, Smooth(), tmp_path, obstacles) for obstacles in lists]
    assert len(set(paths)) == len(lists)
    again = build_road(TRACK, Smooth(), tmp_path / "again", lists[3])
    assert again.read_bytes() == paths[3].read_bytes()


@pytest.mark.parametrize("name", ["hockenheim", "heilbronn"])
def test_a_finer_road_lies_where_the_track_lies(tmp_path: Path, name: str) -> None:
    track = load_track(name)
    path = build_road(track, Smooth(), tmp_path, [Hump(50.0, 0.1, 1.0)])
    with pycrg.DataSet.open(path, check=True) as data:
        point = data.create_contact_point()
        for s in np.arange(60.0, track.length, 23.7):
            pose = track.pose(s)
            assert point.uv_to_xy(s, 0.0) == pytest.approx((pose.x, pose.y), abs=2e-3)
            assert point.uv_to_z(s, 1.0) == pytest.approx(pose.z + pose.banking, abs=1e-3)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Bumps(0.0, 0.5, 4.0), "height is 0 m; it must be positive"),
        (lambda: Bumps(0.03, 0.5, 0.3), r"spacing of 0\.3 m is less than"),
        (lambda: Bumps(0.03, 0.5, 4.0, 20.0, 20.3), "no room for a bump"),
        (lambda: Hump(30.0, 0.05, 0.1), r"length of 0\.1 m is too short .* resolves 0\.2 m"),
        (lambda: Hump(2.0, 0.05, 1.0), "begins at 2 m, where the car starts; 3 m is the first"),
        (lambda: Hump(30.0, 0.0, 1.0), "height is 0 m; leave the hump out"),
        (lambda: Pothole(30.0, 0.05, 0.5, 0.5, edge=0.02), r"edge is 0\.02 m wide; .* 0\.05 m"),
        (lambda: Pothole(30.0, 0.05, 0.2, 0.5), r"length of 0\.2 m is too small: .* need 0\.25 m"),
        (lambda: Pothole(30.0, 0.05, 0.5, 0.2), r"width of 0\.2 m is too small"),
        (lambda: Pothole(30.0, 0.05, 0.5, 2.0), r"reaches from -0\.19 m to 1\.81 m beside"),
        (lambda: Pothole(30.0, 0.0, 0.5, 0.5), "leave the pothole out"),
    ],
)
def test_what_the_grid_cannot_carry_is_refused(make: object, sentence: str) -> None:
    with pytest.raises(RoadError, match=sentence):
        make()  # type: ignore[operator]


def test_a_road_that_is_too_large_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RoadError, match="million points, more than 16 million: take a shorter"):
        road_grid(load_track("straight", 20_000.0).s, Cobbles(1))
