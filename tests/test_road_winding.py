"""The winding road: its bends, its seed, and what it is asked for wrongly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from cosim.course import course_of
from cosim.errors import InputError
from cosim.road import RoadError
from cosim.road.track import DS
from cosim.road.winding import SHORTEST, load_winding
from cosim.scenario.load import load

SEEDS = st.integers(0, 2**31)


@settings(max_examples=15, deadline=None)
@given(SEEDS, st.floats(SHORTEST, 4000))
def test_bends_are_of_25_to_400_metres(seed: int, length: float) -> None:
    track = load_winding(length, seed)
    assert track.length == pytest.approx(length)
    tightest = np.abs(track.curvature).max()
    assert 1 / 400 < tightest < 1 / 24.9
    assert track.curvature[track.s <= 30].tolist() == [0.0] * int((track.s <= 30).sum())
    assert (track.speed_limit == 120 / 3.6).all()
    for flat in (track.z, track.grade, track.banking):
        assert not flat.any()


@settings(max_examples=10, deadline=None)
@given(SEEDS)
def test_curvature_changes_along_clothoids(seed: int) -> None:
    """Its slope is bounded: no bend begins at once, whatever the length of its neighbours."""
    track = load_winding(2500, seed)
    slope = np.abs(np.diff(track.curvature)) / DS
    assert slope.max() < 1 / 25 / 10
    turned = np.concatenate(([0.0], np.cumsum(0.5 * (track.curvature[1:] + track.curvature[:-1]))))
    np.testing.assert_allclose(track.heading - track.heading[0], turned * DS, atol=1e-3)


@settings(max_examples=10, deadline=None)
@given(SEEDS)
def test_the_road_never_meets_itself(seed: int) -> None:
    """Places more than 30 m apart along the road are more than 15 m apart on the ground."""
    track = load_winding(4000, seed)
    every = 40
    points = np.column_stack((track.x, track.y))[::every]
    near = KDTree(points).query_pairs(15.0)
    assert max((abs(i - j) * every * DS for i, j in near), default=0.0) < 30.0


def test_the_seed_is_the_road() -> None:
    first = load_winding(1500.0, 7)
    load_winding.cache_clear()
    again, other = load_winding(1500.0, 7), load_winding(1500.0, 8)
    assert again is not first
    for a, b in zip(first.lines(), again.lines(), strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(first.curvature, other.curvature)


def scenario(folder: Path, road: str, seed: int = 1) -> Path:
    path = folder / "winding.yaml"
    path.write_text(f"name: a\nseed: {seed}\nroad: {{track: winding, {road}}}\n")
    return path


def test_a_scenario_has_its_own_bends_unless_the_road_has_a_seed(tmp_path: Path) -> None:
    roads = [
        course_of(load(scenario(tmp_path, road, seed)), cache_dir=tmp_path).track
        for road, seed in (("length_m: 700", 5), ("length_m: 700, seed: 5", 9))
    ]
    np.testing.assert_array_equal(roads[0].curvature, roads[1].curvature)
    assert roads[0].name == "winding"


@pytest.mark.parametrize(
    ("road", "words"),
    [
        ("surface: A", "the winding track needs its length_m"),
        ("length_m: 700, radius_m: 50", "radius_m belongs to the circle track only"),
        ("length_m: 700, seed: -1", "road.seed must be at least 0"),
    ],
)
def test_what_the_winding_road_needs(tmp_path: Path, road: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load(scenario(tmp_path, road))


def test_a_seed_belongs_to_the_winding_road(tmp_path: Path) -> None:
    path = scenario(tmp_path, "length_m: 700, seed: 3")
    path.write_text(path.read_text().replace("winding", "straight"))
    with pytest.raises(InputError, match="seed belongs to the winding track only"):
        load(path)


def test_a_winding_road_that_is_too_short(tmp_path: Path) -> None:
    with pytest.raises(RoadError, match="needs 600 m, not 599 m"):
        load_winding(599.0, 1)
    with pytest.raises(InputError, match="needs 600 m, not 90 m"):
        course_of(load(scenario(tmp_path, "length_m: 90")))
