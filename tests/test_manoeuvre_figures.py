"""The figures of the standards, on signals whose figures are known."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.manoeuvre.constant import circle_figures, held_figures
from cosim.manoeuvre.evasive import lane_change_figures, slalom_figures
from cosim.manoeuvre.gates import Body, Edge
from cosim.manoeuvre.motion import Motion
from cosim.manoeuvre.open_loop import SineWithDwell, StepSteer, dwell_figures, step_figures
from cosim.manoeuvre.slalom import Cones
from cosim.manoeuvre.straight import change_figures
from cosim.metrics import MANOEUVRE_FIGURES
from cosim.road import load_track
from cosim.road.circle import arc_section, load_circle

Array = npt.NDArray[np.float64]

H = 0.01
BODY = Body(2.3, 2.0, 0.95, 0.95)


def motion(time: Array, **signals: Array) -> Motion:
    """A motion with the given signals, everything else nothing."""
    names = ("x", "y", "yaw", "vx", "ay", "yaw_rate", "steering_wheel")
    nothing = np.zeros_like(time)
    return Motion(time, *(signals.get(name, nothing) for name in names))


# ---------------------------------------------------------------- circle


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("slip_deg", [-3.0, 1.5])
def test_steady_state_of_a_known_circular_motion(side: str, slip_deg: float) -> None:
    track, speed, off = load_circle(60.0, 270.0, side), 20.0, 0.1
    time: Array = np.arange(0.0, track.length / speed, H)
    sign = 1.0 if side == "left" else -1.0
    x, y, heading = (np.interp(speed * time, track.s, q) for q in (track.x, track.y, track.heading))
    driven = motion(
        time,
        x=x - off * np.sin(heading),
        y=y + off * np.cos(heading),
        yaw=heading - sign * math.radians(slip_deg),
        vx=np.full_like(time, speed + 0.2),
        ay=np.full_like(time, sign * 6.7),
        yaw_rate=np.full_like(time, sign * 0.33),
        steering_wheel=np.full_like(time, sign * 1.2),
    )
    start, end = arc_section(track)
    found = circle_figures(driven, track, 0.5 * (start + end), end, speed)
    assert set(found) == set(MANOEUVRE_FIGURES["constant_radius"])
    assert found["speed_mean_kmh"] == pytest.approx(20.2 * 3.6)
    assert found["speed_deviation_kmh"] == pytest.approx(0.2 * 3.6)
    assert found["path_deviation_m"] == pytest.approx(off, abs=1e-3)
    assert found["lateral_acceleration_m_s2"] == pytest.approx(6.7)
    assert found["side_slip_deg"] == pytest.approx(slip_deg, abs=0.02)
    assert found["steering_wheel_deg"] == pytest.approx(math.degrees(1.2))
    assert found["yaw_rate_deg_s"] == pytest.approx(math.degrees(0.33))


def test_a_run_cut_short_has_no_figures() -> None:
    track = load_track("straight", 200.0)
    time: Array = np.arange(0.0, 2.0, H)
    driven = motion(time, x=10.0 * time, vx=np.full_like(time, 10.0))
    assert held_figures(driven, track, 30.0, 200.0, 10.0) == {}
    assert slalom_figures(driven, track, BODY, Cones(10.0, 18.0, 5), 10.0) == {}
    assert lane_change_figures(driven, track, BODY, (Edge(5.0, 50.0, -1.2, True),)) == {}
    assert dwell_figures(driven, 10, 1.93, 1.0) == {}
    assert dwell_figures(driven, -1, 1.93, 1.0) == {}
    assert step_figures(driven, 150, 1.0) == {}
    assert step_figures(driven, -1, 1.0) == {}
    assert change_figures(driven, 10, 5.0, track) == {}
    assert change_figures(driven, -1, 5.0, track) == {}


# ---------------------------------------------------------------- cones


def test_figures_of_a_straight_drive_past_cones() -> None:
    track = load_track("straight", 200.0)
    time: Array = np.arange(0.0, 15.0, H)
    driven = motion(
        time,
        x=10.0 * time,
        y=np.full_like(time, 0.3),
        vx=np.full_like(time, 10.0),
        ay=0.1 * np.sin(5 * time),
        yaw_rate=0.02 * np.cos(5 * time),
    )
    edges = (Edge(40.0, 52.0, -1.2, True), Edge(40.0, 52.0, 1.4, False))
    found = lane_change_figures(driven, track, BODY, edges)
    assert set(found) == set(MANOEUVRE_FIGURES["double_lane_change"])
    assert found["clearance_m"] == pytest.approx(1.4 - 0.3 - 0.95)
    assert found["entry_speed_kmh"] == found["exit_speed_kmh"] == pytest.approx(36.0)
    assert found["path_deviation_m"] == pytest.approx(0.3)
    assert found["lateral_acceleration_max_m_s2"] == pytest.approx(0.1, abs=1e-3)
    assert found["yaw_rate_max_deg_s"] == pytest.approx(math.degrees(0.02), abs=1e-2)
    round_cones = slalom_figures(driven, track, BODY, Cones(40.0, 18.0, 5), 9.0)
    assert set(round_cones) == set(MANOEUVRE_FIGURES["slalom"])
    assert round_cones["clearance_m"] == pytest.approx(-0.15 - 0.3 - 0.95)  # right through
    assert round_cones["speed_deviation_kmh"] == pytest.approx(3.6)


# ---------------------------------------------------------------- sine with dwell


def test_the_sine_dwells_at_its_second_peak() -> None:
    test = SineWithDwell(20.0, 40.0, math.radians(80.0), 0.7, 0.5, H)
    assert test.steering_s == pytest.approx(1 / 0.7 + 0.5)
    quarter = 0.25 / 0.7
    angles = [math.degrees(test.angle(quarter * n)) for n in (0, 1, 2, 3)]
    assert angles == pytest.approx([0, 80, 0, -80], abs=1e-9)
    for dwell in (0.1, 0.3, 0.5):
        assert math.degrees(test.angle(3 * quarter + dwell)) == pytest.approx(-80.0)
    middle = 3.5 * quarter + 0.5
    assert math.degrees(test.angle(middle)) == pytest.approx(-80 * math.sin(math.pi / 4))
    assert test.angle(test.steering_s) == pytest.approx(0.0, abs=1e-12)
    assert test.angle(test.steering_s + 1.0) == pytest.approx(0.0, abs=1e-12)
    steps = np.diff([test.angle(t) for t in np.arange(0.0, 3.0, 1e-4)])
    assert np.abs(steps).max() <= 1.001e-4 * math.radians(80.0) * math.tau * 0.7


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_criteria_of_a_known_yaw_response(side: float) -> None:
    """The yaw rate lags by 0.1 s, its second peak is 1.25 times the steering's, and it decays with
    0.5 s from the completion of steer on.
    """
    test = SineWithDwell(20.0, 40.0, side * math.radians(60.0), 0.7, 0.5, H)
    begin, end = 200, 200 * H + test.steering_s
    time: Array = np.arange(0.0, 6.01, H)
    wheel = np.array([test.angle(t - 2.0) if t >= 2.0 else 0.0 for t in time])
    rate = np.array([0.3 * test.angle(t - 2.1) if t >= 2.1 else 0.0 for t in time])
    rate = np.where(side * rate < 0.0, 1.25 * rate, rate)
    tail = time > end
    rate[tail] = -side * 0.1 * np.exp(-(time[tail] - end) / 0.5)
    driven = motion(
        time, x=20.0 * time, y=side * np.clip(time - 2.0, 0.0, None) ** 2, steering_wheel=wheel,
        yaw_rate=rate, vx=np.full_like(time, 20.0), ay=30.0 * rate,
    )  # fmt: skip
    found = dwell_figures(driven, begin, test.steering_s, side)
    peak = 0.3 * 1.25 * math.radians(60.0)
    assert set(found) == set(MANOEUVRE_FIGURES["sine_with_dwell"])
    assert found["yaw_rate_peak_deg_s"] == pytest.approx(math.degrees(peak), rel=1e-3)
    left = [100 * 0.1 * math.exp(-t / 0.5) / peak for t in (1.0, 1.75)]
    assert found["yaw_rate_after_1_00_s_percent"] == pytest.approx(left[0], rel=1e-3)
    assert found["yaw_rate_after_1_75_s_percent"] == pytest.approx(left[1], rel=1e-3)
    assert found["lateral_displacement_m"] == pytest.approx(1.07**2, rel=1e-3)
    assert found["start_speed_kmh"] == pytest.approx(72.0)


# ---------------------------------------------------------------- step steer


def stepped(response: Array, time: Array, side: float = 1.0) -> dict[str, float]:
    """Figures of a response to a step of 0.5 rad that takes 0.1 s from t = 1 s on."""
    test = StepSteer(20.0, 20.0, side * 0.5, 0.1, H)
    wheel = np.array([test.angle(t - 1.0) for t in time])
    driven = motion(
        time, x=20.0 * time, steering_wheel=wheel, yaw_rate=side * response,
        ay=side * 20.0 * response, vx=np.full_like(time, 20.0),
    )  # fmt: skip
    return step_figures(driven, 100, side)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_times_of_a_first_order_response_count_from_half_of_the_steer(side: float) -> None:
    time: Array = np.arange(0.0, 6.001, H)
    lag = 0.2
    response = 0.25 * (1.0 - np.exp(-np.clip(time - 1.05, 0.0, None) / lag))
    found = stepped(response, time, side)
    assert set(found) == set(MANOEUVRE_FIGURES["step_steer"])
    assert found["steering_wheel_deg"] == pytest.approx(math.degrees(0.5))
    assert found["yaw_rate_deg_s"] == pytest.approx(math.degrees(0.25), rel=1e-6)
    assert found["yaw_gain_per_s"] == pytest.approx(0.5, rel=1e-6)
    assert found["yaw_response_time_s"] == pytest.approx(-lag * math.log(0.1), abs=1e-3)
    assert found["lateral_acceleration_response_time_s"] == found["yaw_response_time_s"]
    assert found["yaw_overshoot_percent"] == pytest.approx(0.0, abs=1e-6)


@settings(max_examples=40, deadline=None)
@given(st.floats(0.3, 0.8), st.floats(6.0, 12.0))
def test_overshoot_and_peak_of_a_second_order_response(damping: float, omega: float) -> None:
    """Closed forms: exp(-pi D / sqrt(1 - D^2)) after pi / (omega sqrt(1 - D^2))."""
    time: Array = np.arange(0.0, 8.001, H)
    t, root = np.clip(time - 1.05, 0.0, None), math.sqrt(1 - damping**2)
    wave = np.cos(omega * root * t) + damping / root * np.sin(omega * root * t)
    found = stepped(0.3 * (1.0 - np.exp(-damping * omega * t) * wave), time)
    overshoot = 100 * math.exp(-math.pi * damping / root)
    assert found["yaw_overshoot_percent"] == pytest.approx(overshoot, abs=0.3)
    assert found["yaw_peak_time_s"] == pytest.approx(math.pi / (omega * root), abs=0.008)


# ---------------------------------------------------------------- braking, accelerating


@settings(max_examples=40, deadline=None)
@given(st.floats(2.0, 9.0), st.floats(8.0, 35.0))
def test_braking_to_a_stand_takes_v_squared_over_twice_the_deceleration(
    rate: float, speed: float
) -> None:
    time: Array = np.arange(0.0, 1.0 + speed / rate + 1.0, H)
    v = np.clip(speed - rate * np.clip(time - 1.0, 0.0, None), 0.0, None)
    x = np.concatenate(([0.0], np.cumsum(0.5 * H * (v[1:] + v[:-1]))))
    track = load_track("straight", 1000.0)
    found = change_figures(motion(time, x=x, vx=v), 100, 0.0, track)
    assert set(found) == set(MANOEUVRE_FIGURES["brake"])
    assert found["start_speed_kmh"] == pytest.approx(3.6 * speed)
    assert found["distance_m"] == pytest.approx(speed**2 / (2 * rate), abs=0.02)
    assert found["time_s"] == pytest.approx(speed / rate, abs=0.04)
    assert found["mean_deceleration_m_s2"] == pytest.approx(rate, rel=5e-3)


def test_the_mean_deceleration_leaves_out_the_beginning_and_the_end() -> None:
    """UN R13-H: (vb^2 - ve^2) / (2 (se - sb)) with vb = 0.8 v, ve = 0.1 v."""
    time: Array = np.arange(0.0, 12.0, H)
    v = 20.0 * np.clip(1.0 - ((time - 1.0).clip(0.0) / 8.0) ** 2, 0.0, None)
    x = np.concatenate(([0.0], np.cumsum(0.5 * H * (v[1:] + v[:-1]))))
    found = change_figures(motion(time, x=x, vx=v), 100, 0.0, load_track("straight", 1000.0))

    def place(share: float) -> float:  # where v = share * 20, in closed form
        t = 8.0 * math.sqrt(1.0 - share)
        return 20.0 * (t - t**3 / (3 * 64.0))

    expected = (16.0**2 - 2.0**2) / (2 * (place(0.1) - place(0.8)))
    assert found["mean_deceleration_m_s2"] == pytest.approx(expected, rel=1e-3)


def test_accelerating_is_told_with_a_positive_figure() -> None:
    time: Array = np.arange(0.0, 8.0, H)
    v = 10.0 + 2.0 * np.clip(time - 1.0, 0.0, None)
    x = np.concatenate(([0.0], np.cumsum(0.5 * H * (v[1:] + v[:-1]))))
    yaw = np.where(time > 3.0, -0.02, 0.0)
    driven = motion(time, x=x, vx=v, yaw=yaw, y=np.where(time > 4.0, 0.1, 0.0))
    found = change_figures(driven, 100, 20.0, load_track("straight", 300.0))
    assert set(found) == set(MANOEUVRE_FIGURES["accelerate"])
    assert found["mean_acceleration_m_s2"] == pytest.approx(2.0, rel=1e-3)
    assert found["time_s"] == pytest.approx(5.0, abs=0.02)
    assert found["distance_m"] == pytest.approx(75.0, abs=0.3)
    assert found["yaw_change_deg"] == pytest.approx(math.degrees(0.02))
    assert found["path_deviation_m"] == pytest.approx(0.1, abs=1e-6)
