"""Layouts, clothoids and the line that a track follows (cosim.road.elements, cosim.road.track)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from cosim.road import RoadError, Stop
from cosim.road.elements import Arc, Straight, close_circuit, curvature_profile, parse_layout
from cosim.road.track import (
    DS,
    LEAD_IN,
    RUN_OUT,
    Layout,
    build_track,
    smooth_steps,
)

BEND = "S60 L50/90 S40 R30/45 S80"


def bend(**changes: object) -> Layout:
    return replace(Layout(name="bend", elements=parse_layout(BEND), transition=12.0), **changes)


def test_a_layout_is_read_word_by_word() -> None:
    assert parse_layout("S60 L50/90 R30.5/45") == (
        Straight(60.0),
        Arc(50.0, 90.0, True),
        Arc(30.5, 45.0, False),
    )


@pytest.mark.parametrize("word", ["X5", "S", "S-5", "L50", "R50/x", "S5/6"])
def test_a_word_that_is_no_element_is_named(word: str) -> None:
    with pytest.raises(RoadError, match=f"'{word}' is no road element"):
        parse_layout(f"S10 {word}")


def test_clothoids_keep_length_and_every_heading_change() -> None:
    track = build_track(bend())
    assert track.length == pytest.approx(60 + 40 + 80 + 50 * math.pi / 2 + 30 * math.pi / 4)
    middle = 60 + 50 * math.pi / 2 + 20  # of the straight between the two arcs
    assert math.degrees(track.pose(middle).heading) == pytest.approx(90.0)
    assert math.degrees(track.heading[-1]) == pytest.approx(45.0)


def test_curvature_has_no_jumps_and_reaches_the_arcs() -> None:
    track = build_track(bend())
    assert np.abs(np.diff(track.curvature)).max() <= 1.001 * DS / 30.0 / 12.0
    assert track.curvature.max() == pytest.approx(1 / 50)
    assert track.curvature.min() == pytest.approx(-1 / 30)


def test_short_elements_shorten_their_clothoids() -> None:
    profile = curvature_profile(parse_layout("S5 L20/10 S5"), 30.0)
    assert np.all(np.diff(profile.x) > 0)


def test_the_line_is_the_integral_of_its_curvature() -> None:
    track = build_track(bend(heading=0.3))
    dx, dy = np.diff(track.x), np.diff(track.y)
    assert np.hypot(dx, dy) == pytest.approx(DS, rel=1e-6)
    middle = 0.5 * (track.heading[1:] + track.heading[:-1])
    assert np.abs(np.arctan2(dy, dx) - middle).max() < 1e-6
    turned = np.cumsum(0.5 * (track.curvature[1:] + track.curvature[:-1]) * DS)
    assert track.heading[1:] - track.heading[0] == pytest.approx(turned, abs=1e-4)


def test_an_arc_is_where_geometry_puts_it() -> None:
    track = build_track(bend(elements=parse_layout("S0.001 L50/90 S0.001"), transition=0.001))
    pose = track.pose(50 * math.pi / 2)
    assert (pose.x, pose.y) == pytest.approx((50.0, 50.0), abs=0.01)


def test_the_road_reaches_before_the_start_and_behind_the_end() -> None:
    track = build_track(bend())
    assert track.s[0] == -LEAD_IN
    assert track.s[-1] >= track.length + RUN_OUT
    assert (track.pose(0.0).x, track.pose(0.0).y, track.pose(0.0).z) == pytest.approx((0, 0, 0))
    assert track.curvature[track.s < 0].max() == 0.0


def test_elevation_is_the_integral_of_the_grade() -> None:
    track = build_track(bend(grade=((10.0, 0.0), (60.0, 0.06), (150.0, 0.0))))
    assert np.gradient(track.z, DS)[1:-1] == pytest.approx(track.grade[1:-1], abs=1e-6)
    assert track.z[-1] == pytest.approx(0.06 * 0.5 * 140.0)
    assert np.abs(np.diff(track.grade, 2)).max() < 1e-5 * DS  # no kink


def test_smooth_steps_stay_between_their_knots() -> None:
    step = smooth_steps(((0.0, 0.0), (10.0, 1.0), (20.0, -1.0)))
    values = step(np.linspace(-5.0, 25.0, 301))
    assert values.min() == -1.0
    assert values.max() == 1.0
    assert values[0] == 0.0
    assert values[-1] == -1.0


def test_limits_hold_from_their_place_on_and_stops_are_kept() -> None:
    track = build_track(bend(limits=((0.0, 50.0), (100.0, 72.0)), stops=(Stop(50.0, 3.0),)))
    assert track.speed_limit_at(-10.0) == pytest.approx(50 / 3.6)
    assert track.speed_limit_at(99.0) == pytest.approx(50 / 3.6)
    assert track.speed_limit_at(101.0) == pytest.approx(20.0)
    assert track.stops[0].dwell == 3.0


def test_the_nearest_place_and_its_offset() -> None:
    track = build_track(bend())
    for s in np.arange(0.0, track.length, 7.3):
        pose = track.pose(s)
        x = pose.x - 2.0 * math.sin(pose.heading)
        y = pose.y + 2.0 * math.cos(pose.heading)
        for near in (None, s - 3.0):
            assert track.nearest(x, y, near) == pytest.approx((s, 2.0), abs=2e-3)


def test_a_circuit_is_closed_by_two_straights() -> None:
    elements = parse_layout("S100 R40/90 S60 R40/90 S110 R40/90 S62 R40/90 S5")
    closed = close_circuit(elements, 10.0, (2, 8))
    track = build_track(Layout("ring", closed, 10.0, closed=True))
    pose = track.pose(track.length)
    assert (pose.x, pose.y, pose.heading) == pytest.approx((0.0, 0.0, -2.0 * math.pi), abs=1e-6)
    before, after = track.pose(-5.0), track.pose(track.length - 5.0)
    assert (before.x, before.y) == pytest.approx((after.x, after.y), abs=1e-6)
    assert track.nearest(0.0, 1.0) == pytest.approx((0.0, 1.0), abs=1e-3)  # the first of equals
    assert track.nearest(0.0, 1.0, track.length)[0] == pytest.approx(track.length, abs=1e-3)


def test_circuits_that_cannot_close_are_refused() -> None:
    with pytest.raises(RoadError, match=r"turns by -270\.000 deg"):
        close_circuit(parse_layout("S10 R40/270 S10"), 5.0, (0, 2))
    with pytest.raises(RoadError, match="cannot close the circuit"):
        close_circuit(
            parse_layout("S100 R40/90 S60 R40/90 S100 R40/90 S200 R40/90 S5"), 5.0, (2, 8)
        )
