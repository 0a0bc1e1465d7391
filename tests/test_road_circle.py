"""The circle of ISO 4138 against plane geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.road import RoadError
from cosim.road.circle import ENTRY, arc_section, load_circle

RADII = st.floats(10.0, 300.0)
ANGLES = st.floats(30.0, 360.0)
SIDES = st.sampled_from(("left", "right"))


@settings(max_examples=25, deadline=None)
@given(RADII, ANGLES, SIDES)
def test_it_turns_by_its_angle_at_its_radius(radius: float, angle: float, side: str) -> None:
    track, sign = load_circle(radius, angle, side), 1.0 if side == "left" else -1.0
    assert track.curvature.max() - track.curvature.min() == pytest.approx(1.0 / radius)
    turned = track.heading[-1] - track.heading[0]
    assert turned == pytest.approx(sign * math.radians(angle), rel=1e-9)
    start, end = arc_section(track)
    arc = (track.s >= start) & (track.s <= end)
    assert track.curvature[arc] == pytest.approx(sign / radius, rel=1e-8)


@pytest.mark.parametrize("side", ["left", "right"])
def test_all_of_the_arc_is_one_radius_from_one_point(side: str) -> None:
    radius = 60.0
    track = load_circle(radius, 270.0, side)
    start, end = arc_section(track)
    arc = (track.s >= start) & (track.s <= end)
    normal = (1.0 if side == "left" else -1.0) * radius
    x = track.x[arc] - normal * np.sin(track.heading[arc])
    y = track.y[arc] + normal * np.cos(track.heading[arc])
    assert np.ptp(x) < 1e-6
    assert np.ptp(y) < 1e-6
    # Clothoids of half the radius stand half before and half behind the ends of the bare arc.
    assert start == pytest.approx(ENTRY + 0.25 * radius, abs=0.06)
    assert end - start == pytest.approx(1.5 * math.pi * radius - 0.5 * radius, abs=0.11)


def test_left_and_right_are_mirror_images() -> None:
    left, right = (load_circle(30.0, 200.0, side) for side in ("left", "right"))
    np.testing.assert_allclose(left.y, -right.y, atol=1e-9)
    np.testing.assert_allclose(left.x, right.x, atol=1e-9)


def test_what_cannot_be_built_is_said() -> None:
    with pytest.raises(RoadError, match="at least 10 m and an angle of 30 to 360 deg"):
        load_circle(5.0)
    with pytest.raises(RoadError, match="at least 10 m and an angle of 30 to 360 deg"):
        load_circle(50.0, 400.0)
    with pytest.raises(RoadError, match="'lef' is not left or right; did you mean 'left'"):
        load_circle(50.0, 90.0, "lef")
