"""Gates, cones and the paths between them against geometry."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.interpolate import PPoly

from cosim.manoeuvre.gates import Body, Edge, clearance, lateral_extent
from cosim.manoeuvre.lane_change import MARGIN, edges, gates, gentlest_path, moved
from cosim.manoeuvre.line import beside, deviation
from cosim.manoeuvre.motion import Motion
from cosim.manoeuvre.slalom import CONE_RADIUS, Cones, path
from cosim.road import load_track

Array = npt.NDArray[np.float64]

EVOQUE = Body(front=2.319, rear=2.051, left=0.9155, right=0.9845)
SIDE_SLIP = 1.236 - 0.0058 * (30 / 3.6) ** 2  # rad m at 30 km/h


def moving(x: Array, y: Array, yaw: Array) -> Motion:
    """A motion of which only the place counts."""
    nothing = np.zeros_like(x)
    return Motion(nothing, x, y, yaw, nothing, nothing, nothing, nothing)


def along(offset: PPoly, first: float, last: float, side_slip: float = 0.0) -> Motion:
    """A body that follows an offset from the x axis exactly."""
    x = np.arange(first, last, 0.02)
    inside = np.clip(x, offset.x[0], offset.x[-1])
    slope, bend = (np.where(inside == x, offset.derivative(n)(inside), 0.0) for n in (1, 2))
    return moving(x, offset(inside), np.arctan(slope) - side_slip * bend)


# ---------------------------------------------------------------- the body and edges


def outline(body: Body, x: float, y: float, yaw: float) -> Array:
    """Points all around the body, (n, 2)."""
    u = np.linspace(-body.rear, body.front, 4001)
    v = np.linspace(-body.right, body.left, 2001)
    sides = [np.column_stack((u, np.full_like(u, w))) for w in (body.left, -body.right)]
    sides += [np.column_stack((np.full_like(v, w), v)) for w in (body.front, -body.rear)]
    points = np.concatenate(sides)
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    return np.asarray(points @ turn.T + [x, y])


@settings(max_examples=60, deadline=None)
@given(st.floats(-3, 3), st.floats(-2, 2), st.floats(-3.1, 3.1), st.floats(-4, 4), st.floats(0, 5))
def test_lateral_extent_is_that_of_the_points_around_the_body(
    x: float, y: float, yaw: float, start: float, length: float
) -> None:
    assume(min(abs(np.sin(yaw)), abs(np.cos(yaw))) > 0.05)  # else a side lies along the border
    points = outline(EVOQUE, x, y, yaw)
    inside = points[(points[:, 0] >= start - 1e-3) & (points[:, 0] <= start + length + 1e-3)]
    assume(len(inside) > 20)  # not only a corner that touches the strip
    corners = EVOQUE.corners(*(np.array([value]) for value in (x, y, yaw)))
    low, high = lateral_extent(*corners, start, start + length)
    assert low[0] == pytest.approx(inside[:, 1].min(), abs=0.05)
    assert high[0] == pytest.approx(inside[:, 1].max(), abs=0.05)


def test_clearance_of_a_straight_drive_is_the_gap_to_the_cones() -> None:
    x = np.arange(-10.0, 40.0, 0.1)
    motion = moving(x, np.full_like(x, 0.2), np.zeros_like(x))
    left, right = Edge(5.0, 9.0, 1.5, keep_left=False), Edge(20.0, 20.0, -1.0, keep_left=True)
    assert clearance(motion, EVOQUE, [left]) == pytest.approx(1.5 - 0.2 - EVOQUE.left)
    assert clearance(motion, EVOQUE, [right]) == pytest.approx(1.0 + 0.2 - EVOQUE.right)
    assert clearance(motion, EVOQUE, [left, right]) == pytest.approx(0.2155)


def test_a_touched_cone_is_a_negative_clearance_and_an_unpassed_one_none() -> None:
    x = np.arange(0.0, 30.0, 0.1)
    motion = moving(x, np.zeros_like(x), np.zeros_like(x))
    touched = Edge(12.0, 12.0, 0.5, keep_left=False)
    assert clearance(motion, EVOQUE, [touched]) == pytest.approx(0.5 - EVOQUE.left)
    beyond = Edge(30.0, 40.0, 3.0, keep_left=False)
    assert clearance(motion, EVOQUE, [touched, beyond]) is None


def test_a_turned_body_sweeps_more_room() -> None:
    """A corner stands out by length times sine, less what the cosine takes off the width."""
    x = np.arange(-10.0, 30.0, 0.01)
    yaw = np.radians(5.0)
    motion = moving(x, np.zeros_like(x), np.full_like(x, yaw))
    found = clearance(motion, EVOQUE, [Edge(0.0, 10.0, 2.0, keep_left=False)])
    corner = EVOQUE.front * np.sin(yaw) + EVOQUE.left * np.cos(yaw)
    assert found == pytest.approx(2.0 - corner, abs=1e-6)


# ---------------------------------------------------------------- ISO 3888-2


def test_gates_of_a_car_1_90_m_wide() -> None:
    first, third, fifth = gates(1.90)
    assert first.left - first.right == pytest.approx(1.1 * 1.90 + 0.25)
    assert third.left - third.right == pytest.approx(2.90)
    assert fifth.left - fifth.right == pytest.approx(3.0)  # 1.3 b + 0.25 is only 2.72 m
    assert third.right - first.left == pytest.approx(1.0)
    assert fifth.right == first.right
    assert [(g.start, g.end) for g in (first, third, fifth)] == [(0, 12), (25.5, 36.5), (49, 61)]
    wide = gates(2.5)[2]
    assert wide.left - wide.right == pytest.approx(1.3 * 2.5 + 0.25)


@pytest.mark.parametrize("side_slip", [0.0, SIDE_SLIP, 1.236 - 0.0058 * (55 / 3.6) ** 2])
@pytest.mark.parametrize("width", [1.6, 1.9, 2.2])
def test_the_planned_path_leaves_room_to_every_gate(width: float, side_slip: float) -> None:
    body = Body(EVOQUE.front, EVOQUE.rear, 0.5 * width, 0.5 * width)
    sections = gates(width)
    planned = gentlest_path(sections, body, side_slip)
    found = clearance(along(planned, -10, 80, side_slip), body, edges(sections, 0.0, 0.0))
    assert found is not None
    # The programme takes angles as small and looks once a metre.
    assert MARGIN - 0.05 < found < MARGIN + 0.02
    assert planned(0.0) == planned(0.0, 1) == 0.0
    assert abs(planned(planned.x[-1], 1)) < 1e-9
    assert abs(planned(planned.x[-1], 2)) < 1e-9


def test_no_bending_less_than_the_gentlest_path() -> None:
    """Any path from one gate to the next has to get across: its largest curvature cannot be below
    that of two arcs between the places where the body is still, and already, inside.
    """
    sections = gates(1.90)
    planned = gentlest_path(sections, EVOQUE, 0.0)
    most = np.abs(planned.derivative(2)(planned.x)).max()
    length = 25.5 + EVOQUE.rear + EVOQUE.front  # from straight at the entry to level in section 3
    across = sections[1].right + EVOQUE.right - (sections[0].left - EVOQUE.left)
    assert most > 4.0 * across / length**2
    assert most < 0.04  # 7 m/s2 at 48 km/h: the car passes at 50 km/h and more


def test_a_body_wider_than_the_gates_is_told() -> None:
    with pytest.raises(ValueError, match="nothing leads a body of this shape through the gates"):
        gentlest_path(gates(1.0), Body(2.3, 2.0, 1.0, 1.0), 0.0)


def test_a_path_can_be_moved() -> None:
    planned = gentlest_path(gates(1.90), EVOQUE, 0.0)
    shifted = moved(planned, 30.0, -1.8)
    x = np.linspace(0.0, 71.0, 50)
    np.testing.assert_allclose(shifted(x + 30.0), planned(x) - 1.8, atol=1e-12)


# ---------------------------------------------------------------- slalom


@settings(max_examples=30, deadline=None)
@given(st.floats(8, 60), st.integers(3, 20), st.floats(0.1, 2.0))
def test_the_slalom_has_its_extremum_at_every_cone(spacing: float, count: int, room: float) -> None:
    cones = Cones(70.0, spacing, count)
    planned = path(cones, EVOQUE, room)
    for i, place in enumerate(cones.places):
        side = EVOQUE.right if i % 2 == 0 else EVOQUE.left
        assert abs(planned(place)) == pytest.approx(CONE_RADIUS + room + side)
        assert np.sign(planned(place)) == (1.0 if i % 2 == 0 else -1.0)
        assert abs(planned(place, 1)) < 1e-9
    x = np.linspace(70.0 - spacing, cones.places[-1] + spacing, 4000)
    amplitude = CONE_RADIUS + room + 0.5 * EVOQUE.width
    assert np.abs(planned(x)).max() < CONE_RADIUS + room + EVOQUE.right + 1e-6
    # no sharper anywhere than a sine of the same amplitude is at its peaks
    assert np.abs(planned(x, 2)).max() < 1.05 * amplitude * (np.pi / spacing) ** 2 + 1e-9


def test_who_drives_the_planned_slalom_clears_the_cones() -> None:
    cones = Cones(40.0, 18.0, 8)
    found = clearance(along(path(cones, EVOQUE, 0.5), 0.0, 200.0), EVOQUE, cones.edges)
    assert found == pytest.approx(0.5, abs=0.01)


# ---------------------------------------------------------------- lines beside the road


def checked(offset: PPoly, end: float) -> None:
    """Heading and curvature are the derivatives of the line's own place along its own length."""
    line = beside(load_track("straight", end + 20.0), offset, end)
    ds = np.hypot(np.diff(line.x), np.diff(line.y))
    np.testing.assert_allclose(ds, np.diff(line.s), rtol=2e-4)
    heading = np.arctan2(np.diff(line.y), np.diff(line.x))
    np.testing.assert_allclose(0.5 * (line.heading[1:] + line.heading[:-1]), heading, atol=2e-4)
    turned = np.cumsum(0.5 * (line.curvature[1:] + line.curvature[:-1]) * np.diff(line.s))
    np.testing.assert_allclose(turned, line.heading[1:] - line.heading[0], atol=2e-3)
    assert line.pose(0.0).x == pytest.approx(0.0, abs=1e-6)
    assert line.pose(line.length).x == pytest.approx(end, abs=0.02)


def test_a_line_beside_the_road_is_measured_along_itself() -> None:
    checked(path(Cones(40.0, 12.0, 6), EVOQUE, 0.8), 130.0)
    checked(moved(gentlest_path(gates(1.9), EVOQUE, 0.0), 20.0, -1.8), 91.0)


@pytest.mark.parametrize("off", [-0.3, 0.0, 0.12])
def test_the_deviation_from_a_line_is_found_again(off: float) -> None:
    line = beside(load_track("straight", 200.0), path(Cones(40.0, 18.0, 5), EVOQUE, 0.5), 150.0)
    rows = slice(round(20 / 0.05), round(150 / 0.05), 4)  # from s = 0 on
    x = line.x[rows] - off * np.sin(line.heading[rows])
    y = line.y[rows] + off * np.cos(line.heading[rows])
    found = deviation(moving(x, y, line.heading[rows]), line, 30.0, 120.0)
    assert len(found) > 300
    np.testing.assert_allclose(found, off, atol=2e-3)


def test_nothing_driven_is_no_deviation() -> None:
    empty: Sequence[float] = ()
    nothing = np.array(empty, dtype=np.float64)
    track = load_track("straight", 100.0)
    assert len(deviation(moving(np.zeros(1), np.zeros(1), np.zeros(1)), track, 5.0, 9.0)) == 0
    assert clearance(moving(nothing, nothing, nothing), EVOQUE, [Edge(0, 1, 0, True)]) is None
