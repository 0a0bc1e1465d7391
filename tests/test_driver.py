"""The driver and his speed profiles: closed forms, laps, stops, slopes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from loop_rig import Blind

from cosim.assembly import STEP_S
from cosim.control.fixed import FixedDampers
from cosim.driver import PathDriver
from cosim.driver_model import DriverModel
from cosim.fmi import Description, Value
from cosim.loop import Blocks
from cosim.loop import run as run_loop
from cosim.manoeuvre.line import deviation
from cosim.manoeuvre.motion import motion_of
from cosim.realtime.clock import Clock
from cosim.record import record_groups
from cosim.recorder import Recorder
from cosim.road import Smooth, Stop, Track, build_road, load_track
from cosim.road.circle import load_circle
from cosim.road.elements import Arc, Straight
from cosim.road.track import Knots, Layout, build_track
from cosim.speed_profile import STYLES, Style, speed_profile, travel_time
from cosim.testbench import State
from cosim.vehicle import Vehicle, builtin_fmu
from cosim.wiring import own_wiring
from sensor.conditions import Measurement

Array = npt.NDArray[np.float64]

TRACKS = ("hockenheim", "heilbronn", "rural")
NORMAL = STYLES["normal"]
WAIT = 2.0


def straight(
    length: float = 300.0, *stops: Stop, grade: Knots = ((0.0, 0.0),), limit: float = 120.0
) -> Track:
    layout = Layout(
        "test", (Straight(length),), 0.0, grade=grade, limits=((0.0, limit),), stops=stops
    )
    return build_track(layout)


def bend(radius: float, left: bool = True) -> Track:
    """Sixty degrees of a circle between two straights."""
    elements = Straight(80.0), Arc(radius, 60.0, left), Straight(80.0)
    return build_track(Layout("bend", elements, 10.0, limits=((0.0, 120.0),)))


def at(track: Track, values: Array, s: float) -> float:
    return float(np.interp(s, track.s, values))


def on_lap(track: Track) -> npt.NDArray[np.bool_]:
    return np.asarray((track.s >= 0) & (track.s <= track.length))


# ---------------------------------------------------------------- speed profile


@pytest.mark.parametrize("radius", [20.0, 60.0, 150.0])
@pytest.mark.parametrize("style", STYLES)
def test_in_a_bend_the_lateral_limit_sets_the_speed(radius: float, style: str) -> None:
    track = bend(radius)
    speed = speed_profile(track, STYLES[style])
    middle = 80.0 + 0.5 * math.radians(60.0) * radius
    assert at(track, speed, middle) == pytest.approx(
        math.sqrt(STYLES[style].corner * radius), rel=1e-3
    )


@pytest.mark.parametrize("style", STYLES)
def test_straight_braking_and_starting(style: str) -> None:
    """v^2 = 2 a s on both sides of a stop, up to the speed limit."""
    track, limits = straight(600.0, Stop(300.0, WAIT)), STYLES[style]
    speed = speed_profile(track, limits)
    for distance in (1.0, 5.0, 20.0, 40.0):
        before, behind = (at(track, speed, 300.0 + d) for d in (-distance, distance))
        assert before**2 == pytest.approx(2 * limits.brake * distance, rel=0.01, abs=0.5)
        assert behind**2 == pytest.approx(2 * limits.accelerate * distance, rel=0.01, abs=0.5)
    assert speed.min() == 0.0
    assert speed.max() == pytest.approx(120 / 3.6)


@pytest.mark.parametrize("name", TRACKS)
@pytest.mark.parametrize("style", STYLES)
def test_the_ellipse_holds_everywhere(name: str, style: str) -> None:
    track, limits = load_track(name), STYLES[style]
    speed = speed_profile(track, limits)
    square, bend = speed**2, np.abs(track.curvature)
    along = np.diff(square) / (2 * np.diff(track.s))
    # Of a step, the end where it is faster counts less: its lateral share is that of the other.
    across = (np.minimum(square[:-1], square[1:]) * np.minimum(bend[:-1], bend[1:])) / limits.corner
    longitudinal = np.where(along > 0, along / limits.accelerate, along / limits.brake)
    used = np.hypot(across, longitudinal)
    assert used.max() < 1.005
    both = (across > 0.4) & (across < 0.8)
    assert used[both].max() > 0.98  # in a bend, what is left along the way is used
    assert (square * bend).max() <= limits.corner * (1 + 1e-9)
    assert np.abs(longitudinal).max() > 0.98


@pytest.mark.parametrize("name", TRACKS)
def test_who_may_accelerate_more_is_nowhere_slower(name: str) -> None:
    track = load_track(name)
    profiles = [
        speed_profile(track, STYLES[style]) for style in ("aggressive", "normal", "defensive")
    ]
    for faster, slower in pairwise(profiles):
        assert (faster >= slower - 1e-9).all()
        assert travel_time(track, faster) < travel_time(track, slower)


@pytest.mark.parametrize("name", TRACKS)
def test_limits_of_the_track_and_the_cap_hold(name: str) -> None:
    track = load_track(name)
    free, capped = speed_profile(track, NORMAL), speed_profile(track, NORMAL, 10.0)
    assert (free <= track.speed_limit + 1e-9).all()
    assert capped.max() == pytest.approx(10.0)
    assert (capped <= free + 1e-9).all()
    np.testing.assert_array_equal(speed_profile(track, NORMAL, 100.0), free)


def test_a_profile_does_not_know_left_from_right() -> None:
    left, right = (speed_profile(bend(50.0, to_the_left), NORMAL) for to_the_left in (True, False))
    np.testing.assert_allclose(left, right, rtol=1e-12)


def test_who_brakes_as_he_accelerates_drives_the_same_both_ways() -> None:
    even = Style(3.0, 3.0, 4.0)
    track = bend(40.0)
    speed = speed_profile(track, even)[on_lap(track)]
    inside = slice(round(40 / 0.05), -round(40 / 0.05))  # away from what the ends limit
    np.testing.assert_allclose(speed[inside], speed[::-1][inside], rtol=2e-3)


def test_every_stop_is_in_the_profile() -> None:
    track = load_track("heilbronn")
    speed = speed_profile(track, NORMAL)
    for stop in track.stops:
        assert speed[np.abs(track.s - stop.s) < 0.1].min() == 0.0
    assert (speed == 0.0).sum() == len(track.stops)


def test_travel_time_of_a_constant_speed_and_of_a_stop() -> None:
    track = straight(500.0)
    assert travel_time(track, np.full_like(track.s, 20.0)) == pytest.approx(25.0)
    with_stop = straight(500.0, Stop(250.0, 7.0))
    assert travel_time(with_stop, np.full_like(track.s, 20.0)) == pytest.approx(32.0)
    # from 20 m/s with 4 m/s2 to a stop and with 3 m/s2 up again: 2.5 s and 3.33 s more than half
    slowed = travel_time(with_stop, speed_profile(with_stop, NORMAL, 20.0))
    assert slowed == pytest.approx(32.0 + 20 / 8 + 20 / 6, abs=0.6)


# ---------------------------------------------------------------- the driver's sense of direction


def state(x: float, y: float, yaw: float, speed: float) -> State:
    channels = np.zeros(14)
    channels[6] = speed
    return State(channels, np.zeros(4), np.array([x, y, yaw]), np.zeros(14), np.zeros(11))


def first_command(track: Track, x: float, y: float, yaw: float, speed: float) -> list[float]:
    driver = PathDriver(track, speed_profile(track, NORMAL, 15.0), STEP_S)
    command: list[float] = driver.step(0, state(x, y, yaw, speed)).tolist()
    return command


def test_on_the_line_he_steers_straight_on() -> None:
    assert first_command(straight(), 10.0, 0.0, 0.0, 15.0)[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("y", "yaw"), [(1.0, 0.0), (0.0, 0.1), (0.5, 0.05)])
def test_he_steers_back_to_the_line(y: float, yaw: float) -> None:
    to_the_right = first_command(straight(), 10.0, y, yaw, 15.0)[0]
    assert to_the_right < 0
    assert first_command(straight(), 10.0, -y, -yaw, 15.0)[0] == pytest.approx(-to_the_right)


def test_heading_is_taken_modulo_a_turn() -> None:
    once = first_command(straight(), 10.0, 0.0, 0.1, 15.0)[0]
    assert first_command(straight(), 10.0, 0.0, 0.1 - math.tau, 15.0)[0] == pytest.approx(once)


@pytest.mark.parametrize("left", [True, False])
def test_he_steers_into_the_bend_by_the_wheelbase_at_walking_pace(left: bool) -> None:
    """At low speed a car turns by its geometry: steer = ratio * wheelbase / radius."""
    track = bend(30.0, left)
    driver = PathDriver(track, np.full_like(track.s, 1.0), STEP_S)
    for s in np.arange(0.0, 95.0, 0.5):
        pose = track.pose(float(s))
        yaw = pose.heading - 1.236 * pose.curvature  # the rear axle follows the line
        steer = driver.step(0, state(pose.x, pose.y, yaw, 1.0))[0]
    assert steer == pytest.approx((1 if left else -1) * 16.5 * 2.675 / 30.0, rel=0.02)
    assert driver.largest_deviation < 1e-6


@pytest.mark.parametrize(("speed", "pedal"), [(10.0, 1), (20.0, 2)])
def test_too_slow_is_gas_and_too_fast_is_brake(speed: float, pedal: int) -> None:
    driver = PathDriver(straight(), np.full_like(straight().s, 15.0), STEP_S)
    for k in range(50):
        command = driver.step(k, state(10.0 + 0.1 * k, 0.0, 0.0, speed))
    assert command[pedal] > 0.1
    assert command[3 - pedal] == 0.0


def test_he_keeps_the_same_buffer_and_knows_his_deviation() -> None:
    track = straight()
    driver = PathDriver(track, speed_profile(track, NORMAL), STEP_S)
    first = driver.step(0, state(5.0, 0.2, 0.0, 15.0))
    assert driver.step(1, state(5.2, -0.1, 0.0, 15.0)) is first
    assert driver.deviation == pytest.approx(-0.1)
    assert driver.largest_deviation == pytest.approx(0.2)


def test_he_has_finished_at_the_end_of_the_lap_not_of_the_road() -> None:
    track = straight(100.0)
    driver = PathDriver(track, speed_profile(track, NORMAL), STEP_S)
    for x in np.arange(0.0, 99.9, 0.2):
        driver.step(0, state(float(x), 0.0, 0.0, 15.0))
        assert not driver.finished
    driver.step(0, state(100.01, 0.0, 0.0, 15.0))
    assert driver.finished


# ---------------------------------------------------------------- with a car


@dataclass(frozen=True)
class Drive:
    """A car driven over a track: its record, and what was expected of it."""

    expected_s: float
    finished: bool
    largest_deviation: float
    recorder: Recorder

    @property
    def time_s(self) -> float:
        return float(self.recorder.time[-1])

    @property
    def speed(self) -> Array:
        return self.recorder.group("channels")[:, 6]

    @property
    def pedals(self) -> Array:
        return self.recorder.group("driver")[:, 1:]

    @property
    def x(self) -> Array:
        return self.recorder.group("vehicle")[:, 0]


def drive(
    track: Track,
    style: Style,
    folder: Path | None,
    cap: float | None = None,
    y: float = 0.0,
    profile: Array | None = None,
    parameters: dict[str, Value] | None = None,
    model: DriverModel | None = None,
) -> Drive:
    """One lap of the package's own car on the smooth road of a track; `y` m off it at the start."""
    speed = speed_profile(track, style, cap) if profile is None else profile
    expected = travel_time(track, speed)
    pose = track.pose(0.0)
    start: dict[str, Value] = {
        "Init.x": pose.x, "Init.y": pose.y + y, "Init.Yaw": pose.heading, "Damp.Passive": True,
        "Init.Velocity": at(track, speed, 0.0),
        "Road.File": str(build_road(track, Smooth(), folder)),
        **(parameters or {}),
    }  # fmt: skip
    vehicle = Vehicle(Description(builtin_fmu()), own_wiring(), start, STEP_S)
    driver = PathDriver(track, speed, STEP_S, model)
    steps = round(1.3 * expected / STEP_S)
    recorder = Recorder(record_groups(), steps + 1, STEP_S)
    try:
        vehicle.connect()
        blocks = Blocks(vehicle, driver, Measurement("ideal", 1), Blind(), FixedDampers())
        run_loop(blocks, Clock(steps + 1), recorder, steps)
    finally:
        vehicle.stop()
    return Drive(expected, driver.finished, driver.largest_deviation, recorder)


@cache
def lap(name: str, style: str) -> Drive:
    return drive(load_track(name), STYLES[style], None)


LAPS = [
    *(pytest.param("hockenheim", style, id=f"hockenheim-{style}") for style in STYLES),
    pytest.param("rural", "aggressive", id="rural-aggressive"),
    pytest.param("heilbronn", "normal", id="heilbronn-normal"),
]
# Times of the example's own driver on the same circuit.
HOCKENHEIM = {"aggressive": 113.0, "normal": 126.0, "defensive": 150.0}


@pytest.mark.parametrize(("name", "style"), LAPS)
def test_a_lap_keeps_to_the_line_and_to_the_time_of_its_profile(name: str, style: str) -> None:
    done = lap(name, style)
    assert done.finished
    assert done.largest_deviation < 0.25
    waits = len(load_track(name).stops)  # each costs a little more than the profile knows
    assert done.expected_s * 0.99 < done.time_s < done.expected_s * 1.01 + 3.0 * waits


@pytest.mark.parametrize("style", STYLES)
def test_lap_times_of_hockenheim(style: str) -> None:
    assert lap("hockenheim", style).time_s == pytest.approx(HOCKENHEIM[style], rel=0.05)


@pytest.mark.parametrize(("name", "style"), LAPS)
def test_accelerations_of_a_lap_are_those_of_the_style(name: str, style: str) -> None:
    """The car's own pitch and the driver's corrections on top."""
    channels, limits = lap(name, style).recorder.group("channels"), STYLES[style]
    ax, ay = channels[100:, 0], channels[100:, 1]
    assert 0.8 * limits.corner < np.percentile(np.abs(ay), 99.9) < 1.25 * limits.corner
    assert np.percentile(ax, 99.9) < 1.25 * limits.accelerate
    assert np.percentile(ax, 0.1) > -1.3 * limits.brake


@pytest.mark.parametrize(("name", "style"), LAPS)
def test_one_pedal_at_a_time_within_its_travel(name: str, style: str) -> None:
    pedals = lap(name, style).pedals
    assert (pedals >= 0.0).all()
    assert (pedals <= 1.0).all()
    assert (pedals.min(axis=1) == 0.0).all()


def test_a_car_beside_the_line_comes_back_to_it(tmp_path: Path) -> None:
    done = drive(straight(200.0), NORMAL, tmp_path, cap=15.0, y=0.8)
    aside = done.recorder.group("vehicle")[:, 1]
    assert aside[0] == pytest.approx(0.8)
    assert np.abs(aside[done.x > 100.0]).max() < 0.03
    assert aside.min() > -0.1  # without swinging through


def standing(done: Drive, line: float) -> tuple[float, Array]:
    """How long the car stays where it stops before a line [s], and where it is meanwhile [m].

    After the stop the body rocks to and fro by some centimetres, so the place counts and not the
    speed.
    """
    near = (done.x > line - 3.0) & (done.x < line + 1.0)
    place = float(np.median(done.x[near & (np.abs(done.speed) < 0.01)]))
    (still,) = np.nonzero(np.abs(done.x - place) < 0.06)
    assert len(still) == still[-1] - still[0] + 1  # he stops once, and does not come back
    return len(still) * STEP_S, done.x[still]


FLAT: Knots = ((0.0, 0.0),)
UPHILL: Knots = ((0.0, 0.0), (30.0, 0.12), (200.0, 0.12))
DOWNHILL: Knots = ((0.0, 0.0), (30.0, -0.12), (200.0, -0.12))
GRADES = [
    pytest.param(FLAT, id="flat"),
    pytest.param(UPHILL, id="uphill"),
    pytest.param(DOWNHILL, id="downhill"),
]


@pytest.mark.parametrize("grade", GRADES)
@pytest.mark.parametrize("style", STYLES)
def test_he_stops_at_the_line_waits_and_leaves_again(
    tmp_path: Path, grade: Knots, style: str
) -> None:
    line = 80.0
    track = straight(140.0, Stop(line, WAIT), grade=grade)
    done = drive(track, STYLES[style], tmp_path, cap=12.0)
    waited, places = standing(done, line)
    assert done.finished
    assert WAIT <= waited < WAIT + 1.2
    assert line - 1.5 < places.min()
    assert places.max() < line + 0.3
    assert (np.diff(done.x) > -0.01).all()  # he does not roll back
    assert done.time_s < done.expected_s + 5.0
    assert done.largest_deviation < 0.05


@pytest.mark.parametrize("style", STYLES)
def test_he_stops_no_harder_than_he_brakes(tmp_path: Path, style: str) -> None:
    done = drive(straight(140.0, Stop(80.0, WAIT)), STYLES[style], tmp_path, cap=12.0)
    ax = done.recorder.group("channels")[:, 0]
    assert ax[(done.x > 40.0) & (done.x < 81.0)].min() > -1.15 * STYLES[style].brake


# The last two take more lateral acceleration than any style, the last one 0.79 of 0.84 g.
CIRCLES = [(100.0, 50.0, 0.05), (30.0, 50.0, 0.1), (60.0, 75.0, 0.2), (100.0, 100.0, 0.45)]


@pytest.mark.parametrize(("radius", "kmh", "most"), CIRCLES)
@pytest.mark.parametrize("side", ["left", "right"])
def test_he_holds_line_and_speed_whatever_the_bend_asks(
    tmp_path: Path, radius: float, kmh: float, most: float, side: str
) -> None:
    track, speed = load_circle(radius, 200.0, side), kmh / 3.6
    done = drive(track, NORMAL, tmp_path, profile=np.full_like(track.s, speed))
    assert done.finished
    assert done.largest_deviation < most
    ay = done.recorder.group("channels")[len(done.x) // 2, 1]
    assert abs(ay) == pytest.approx(speed**2 / radius, rel=0.02)
    assert np.abs(done.speed[100:] - speed).max() < 0.01 * speed


@pytest.mark.parametrize("kg", [2700.0, 2250.0])
def test_he_learns_how_another_car_steers(tmp_path: Path, kg: float) -> None:
    """In a long bend near the limit the deviation becomes less than half of what it would be."""
    track = load_circle(100.0)
    speed = np.full_like(track.s, 100.0 / 3.6)

    def largest(learning_time: float) -> float:
        model = DriverModel(learning_time=learning_time)
        done = drive(
            track, NORMAL, tmp_path, profile=speed, parameters={"Body.Mass": kg}, model=model
        )
        motion = motion_of(done.recorder)
        return float(np.abs(deviation(motion, track, 300.0, 450.0)).max())

    assert largest(3.0) < 0.5 * largest(1e9)


@pytest.mark.parametrize("line", [60.0, 60.23, 60.475])
def test_a_line_may_be_anywhere_between_two_points_of_the_track(
    tmp_path: Path, line: float
) -> None:
    done = drive(straight(100.0, Stop(line, WAIT)), NORMAL, tmp_path, cap=12.0)
    waited, places = standing(done, line)
    assert done.finished
    assert waited >= WAIT
    assert line - 1.5 < places.mean() < line + 0.3


def test_two_stops_one_after_the_other(tmp_path: Path) -> None:
    track = straight(120.0, Stop(50.0, 1.0), Stop(70.0, 2.0))
    done = drive(track, NORMAL, tmp_path, cap=12.0)
    assert done.finished
    for line, wait in track.stops:
        waited, _ = standing(done, line)
        assert wait <= waited < wait + 1.0


@pytest.mark.parametrize("grade", GRADES)
def test_a_slope_does_not_change_the_speed(tmp_path: Path, grade: Knots) -> None:
    """The driver knows the road: he does not wait until he is too slow."""
    done = drive(straight(190.0, grade=grade), NORMAL, tmp_path, cap=15.0)
    assert done.finished
    assert np.abs(done.speed[100:] - 15.0).max() < 0.5
