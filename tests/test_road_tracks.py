"""The tracks by name (cosim.road.tracks)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cosim.road import TRACK_NAMES, RoadError, Track, load_track
from cosim.road.track import DS


def ideal_time(track: Track, forward: float, backward: float, lateral: float) -> float:
    """Time of a driver who uses an elliptic g-g limit to the full, stops included [s]."""
    on_road = (track.s >= 0.0) & (track.s <= track.length)
    bend = np.abs(track.curvature[on_road])
    speed = np.sqrt(lateral / np.maximum(bend, 1e-6))
    speed = np.minimum(speed, np.minimum(track.speed_limit[on_road], 120 / 3.6))
    for stop in track.stops:
        speed[round(stop.s / DS)] = 0.3
    for limit, order in ((forward, slice(None)), (backward, slice(None, None, -1))):
        pace, turn = speed[order], bend[order]  # views: from the start, then from the end
        for i in range(1, len(pace)):
            left = math.sqrt(max(0.0, 1.0 - (pace[i - 1] ** 2 * turn[i - 1] / lateral) ** 2))
            pace[i] = min(pace[i], math.sqrt(pace[i - 1] ** 2 + 2.0 * DS * limit * left))
    return float(np.sum(DS / speed)) + sum(stop.dwell for stop in track.stops)


@pytest.mark.parametrize("name", TRACK_NAMES)
def test_no_track_comes_near_itself(name: str) -> None:
    track = load_track(name)
    x, y, s = (q[::60] for q in (track.x, track.y, track.s))
    distance = np.hypot(x[:, None] - x, y[:, None] - y)
    along = np.abs(s[:, None] - s)
    if track.closed:
        along = np.minimum(along, np.abs(track.length - along))
    assert distance[along > 60.0].min(initial=math.inf) > 30.0


@pytest.mark.parametrize("name", TRACK_NAMES)
def test_curvature_is_continuous_and_fits_a_road(name: str) -> None:
    track = load_track(name)
    assert np.abs(track.curvature).max() <= 1.0 / 12.0
    assert np.abs(np.diff(track.curvature)).max() < 1e-3
    assert np.abs(np.diff(track.banking)).max() < 0.01 * DS
    assert np.abs(np.diff(track.grade)).max() < 0.002 * DS


def test_hockenheim_closes_at_its_stated_length() -> None:
    track = load_track("hockenheim")
    assert track.closed
    assert track.length == pytest.approx(2597.29, rel=0.005)
    end = track.pose(track.length)
    assert (end.x, end.y, end.z) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert math.degrees(end.heading) == pytest.approx(-360.0, abs=1e-3)


def test_hockenheim_has_its_banking_and_its_dip() -> None:
    track = load_track("hockenheim")
    assert track.pose(1760.0).banking == pytest.approx(-0.08)  # left-hand hairpin: right side up
    assert track.pose(1760.0).curvature == pytest.approx(1 / 40)
    assert track.pose(2230.0).banking == pytest.approx(0.08)
    assert track.pose(2230.0).curvature == pytest.approx(-1 / 69.525)
    assert track.z.min() == pytest.approx(-0.45)
    assert track.s[np.argmin(track.z)] == pytest.approx(2078.5, abs=DS)
    assert track.pose(2000.0).z == pytest.approx(0.0, abs=1e-9)
    assert track.pose(2157.0).z == pytest.approx(0.0, abs=1e-9)


def test_hockenheim_lap_times_are_those_of_the_driver_styles() -> None:
    track = load_track("hockenheim")
    for limits, seconds in (((4, 6, 5), 113.0), ((3, 4, 4), 126.0), ((2, 2, 3), 150.0)):
        assert ideal_time(track, *limits) == pytest.approx(seconds, rel=0.04)


def test_heilbronn_is_hilly_and_averages_55_kmh() -> None:
    track = load_track("heilbronn")
    assert track.length == pytest.approx(5790.0)
    assert np.abs(track.grade).max() == pytest.approx(0.06, abs=1e-6)
    assert len(track.stops) == 5
    caps = track.speed_limit * 3.6
    assert caps.min() == pytest.approx(50.0)
    assert caps.max() == pytest.approx(100.0)
    average = 3.6 * track.length / ideal_time(track, 3.0, 4.0, 4.0)
    assert 53.0 < average < 58.0


def test_the_rural_road_has_roundabouts_and_75_kmh() -> None:
    track = load_track("rural")
    assert track.length == pytest.approx(1760.0)
    assert track.speed_limit.max() == pytest.approx(75 / 3.6)
    tight = track.curvature > 1.0 / 15.0
    assert np.count_nonzero(np.diff(tight.astype(int)) == 1) == 3


def test_the_straight_takes_a_length() -> None:
    assert load_track("straight").length == 1000.0
    track = load_track("straight", 250.0)
    assert track.length == 250.0
    assert not track.y.any()


def test_what_cannot_be_loaded_is_said() -> None:
    with pytest.raises(RoadError, match=r"'hokenheim' is not known.*did you mean 'hockenheim'"):
        load_track("hokenheim")
    with pytest.raises(RoadError, match="track 'rural' has its own length"):
        load_track("rural", 100.0)
    with pytest.raises(RoadError, match="above 0 m and at most 20000 m"):
        load_track("straight", -5.0)


def test_tracks_are_the_same_every_time_and_cannot_be_changed() -> None:
    first = load_track("heilbronn")
    load_track.cache_clear()
    second = load_track("heilbronn")
    for a, b in zip(first.lines(), second.lines(), strict=True):
        assert a.tobytes() == b.tobytes()
    with pytest.raises(ValueError, match="read-only"):
        first.x[0] = 1.0
