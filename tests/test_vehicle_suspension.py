"""Dampers, stops, lift-off, and what vertical motion does to the wheel speeds."""

from pathlib import Path

import numpy as np
import pytest
from gates import at_most, gate
from scipy.interpolate import PchipInterpolator
from vehicle_linear import LinearCar, per_corner
from vehicle_rig import (
    CORNERS,
    DAMPERS,
    TABLE_SPEEDS,
    Array,
    Record,
    Rig,
    cosine_bump,
    each,
    output_names,
    parameter,
    run,
    straight_road,
)

from cosim.fmi import Value


@pytest.fixture(scope="module")
def bumps(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Sharp bumps left and right, then one across the road: the dampers reach 2 m/s."""

    def elevation(s: Array, v: Array) -> Array:
        left = cosine_bump(s, 5.0, 0.8, 0.04) * (v > 0.0)
        right = cosine_bump(s, 10.0, 0.8, 0.04) * (v < 0.0)
        return left + right + cosine_bump(s, 20.0, 3.0, 0.08)

    path = tmp_path_factory.mktemp("bumps") / "bumps.crg"
    return straight_road(path, elevation, columns=np.array([-4.5, -0.1, 0.1, 4.5]))


def over_bumps(road: str, command: float, passive: bool = False) -> Record:
    commands: dict[str, Value] = {f"Car.SuspControl.Damper{c}.CtrlOut": command for c in CORNERS}
    start: dict[str, Value] = {
        "Init.Velocity": 10.0,
        "Road.File": road,
        "Damp.Passive": passive,
        **commands,
    }
    return run(6.0, start)


# ---------------------------------------------------------------- dampers


def damper_table(kind: str) -> tuple[Array, Array]:
    """Velocity in extension and force at a front wheel, from the parameters."""
    count = 6 if kind == "Passive" else 5
    speed = np.array(TABLE_SPEEDS[:count])
    rebound, compression = (
        np.array([parameter(f"Damp.{kind}{way}{k}") for k in range(1, count + 1)])
        for way in ("Rebound", "Compression")
    )
    return np.r_[-speed[::-1], 0.0, speed], np.r_[-compression[::-1], 0.0, rebound]


@pytest.mark.parametrize(
    ("kind", "command"), [("Soft", 0.0), ("Hard", 1.0), ("Passive", 0.0), ("Passive", 1.0)]
)
def test_damper_force(bumps: str, kind: str, command: float) -> None:
    record = over_bumps(bumps, command, passive=kind == "Passive")
    v = -record.corners("Car.C@.q0p")
    ratio = per_corner("Damp.MotionRatio@")
    assert record.corners("Car.Damp@.v") == pytest.approx(ratio * v)
    assert record.corners("Car.Damp@.l") == pytest.approx(-ratio * record.corners("Car.C@.q0"))
    force = record.corners("Car.Damp@.Frc") * ratio / per_corner("Damp.Scale@")
    speed, table = damper_table(kind)
    inside = (v > speed[1]) & (v < speed[-2])
    # the table, monotone between its points (the FMU ends it with the last secant: compare within)
    assert np.abs(force - PchipInterpolator(speed, table)(v))[inside].max() < 1e-6
    for end, inner, beyond in ((-1, -2, v > speed[-1]), (0, 1, v < speed[0])):
        slope = (table[end] - table[inner]) / (speed[end] - speed[inner])
        line = table[end] + slope * (v - speed[end])
        assert np.abs(force - line)[beyond].max(initial=0.0) < 1e-6
    assert (force * v >= 0.0).all()  # opposes: never an active damper
    assert np.abs(v).max() > 1.0  # the bumps reach the table's end


def test_hard_dampers_move_less(bumps: str) -> None:
    travel = [over_bumps(bumps, u).corners("Car.C@.q0").std() for u in (0.0, 0.3, 1.0)]
    assert travel[0] > travel[1] > travel[2]


def test_intermediate_command_is_between(bumps: str) -> None:
    record = over_bumps(bumps, 0.3)
    v = -record.corners("Car.C@.q0p")
    force = (
        record.corners("Car.Damp@.Frc")
        * per_corner("Damp.MotionRatio@")
        / per_corner("Damp.Scale@")
    )
    soft, hard = (PchipInterpolator(*damper_table(kind))(v) for kind in ("Soft", "Hard"))
    inside = np.abs(v) < 0.5
    assert np.abs(force - (soft + 0.3 * (hard - soft)))[inside].max() < 1e-6


def test_valve_lag() -> None:
    def drive(rig: Rig) -> None:
        rig.inputs[DAMPERS] = 1.0 if rig.k >= 100 else 0.0

    record = run(0.2, {}, drive, h=0.001)
    since = record.t - 0.1
    expected = np.where(since > 0.0, 1.0 - np.exp(-since / 0.012), 0.0)
    off = np.abs(record.corners("Car.Damp@.Ctrl") - expected[:, None]).max(axis=0)
    check = "valves, step of the command: position over time, error [-]"
    gate("Dampers", check, "first-order lag of 12 ms", off, at_most(1e-3))


def test_passive_dampers_ignore_the_command(bumps: str) -> None:
    soft, hard = (over_bumps(bumps, u, passive=True).rows for u in (0.0, 1.0))
    motion = ["Ctrl" not in name for name in output_names()]
    assert np.array_equal(soft[:, motion], hard[:, motion])


def test_one_command_moves_one_damper() -> None:
    for i, c in enumerate(CORNERS):
        record = run(0.1, {f"Car.SuspControl.Damper{c}.CtrlOut": 0.7})
        assert record.corners("Car.Damp@.Ctrl")[-1] == pytest.approx(0.7 * np.eye(4)[i])


# ---------------------------------------------------------------- stops and lift-off


@pytest.fixture(scope="module")
def hump(tmp_path_factory: pytest.TempPathFactory) -> str:
    """150 mm over 2 m across the whole road."""
    path = tmp_path_factory.mktemp("hump") / "hump.crg"
    return straight_road(path, lambda s, v: cosine_bump(s, 5.0, 2.0, 0.15) + 0.0 * v)


def test_wheels_lift_off_and_land(hump: str) -> None:
    record = run(5.0, {"Init.Velocity": 15.0, "Road.File": hump, "Damp.Passive": True})
    load = record.corners("Car.Fz@")
    assert np.isfinite(record.rows).all()
    assert load.min() == 0.0
    assert ((load == 0.0).sum(axis=0) >= 5).all()  # every wheel was in the air
    for name in ("Car.Fx@", "Car.Fy@"):
        assert (record.corners(name)[load == 0.0] == 0.0).all()  # no grip there
    assert load[-1] == pytest.approx(LinearCar().loads, rel=0.03)


@pytest.mark.parametrize("stop", ["Bump", "Rebound"])
def test_stops_engage(hump: str, stop: str) -> None:
    gap = per_corner(f"Susp.{stop}Gap@")
    sign = 1.0 if stop == "Bump" else -1.0
    start: dict[str, Value] = {"Init.Velocity": 15.0, "Road.File": hump, "Damp.Passive": True}
    off: dict[str, Value] = {f"Susp.{stop}Rate": 0.0, f"Susp.{stop}Cubic": 0.0}
    reach = [
        (sign * run(1.0, s).corners("Car.C@.q0")).max(axis=0) for s in (start, {**start, **off})
    ]
    assert (reach[0] > gap).all()  # they were touched
    assert (reach[1] > reach[0] + 0.005).all()  # and they stopped something


def test_no_stop_is_touched_on_the_way(bumps: str) -> None:
    """Within the gaps the stops are not there."""

    def elevation(s: Array, v: Array) -> Array:
        return cosine_bump(s, 5.0, 3.0, 0.02) + 0.0 * v

    folder = Path(bumps).parent
    road = straight_road(folder / "low.crg", elevation)
    start: dict[str, Value] = {"Init.Velocity": 10.0, "Road.File": road}
    off: dict[str, Value] = {
        f"Susp.{s}{k}": 0.0 for s in ("Bump", "Rebound") for k in ("Rate", "Cubic")
    }
    assert np.array_equal(run(3.0, start).rows, run(3.0, {**start, **off}).rows)


# ---------------------------------------------------------------- wheel speeds

COUPLINGS: dict[str, dict[str, Value]] = {
    "radius": {"Tire.LoadDependentRadius": False},
    "recession": each("Kin.Recession@", 0.0) | each("Kin.RecessionCurve@", 0.0),
    "knuckle pitch": each("Kin.KnucklePitch@", 0.0),
}
H = 0.002


@pytest.fixture(scope="module")
def swell(tmp_path_factory: pytest.TempPathFactory) -> str:
    """30 mm over 2 m across the whole road."""
    path = tmp_path_factory.mktemp("swell") / "swell.crg"
    return straight_road(path, lambda s, v: cosine_bump(s, 10.0, 2.0, 0.03) + 0.0 * v)


def rigid_wheel_speed(record: Record) -> Array:
    """What the sensors would read if the tyres were rigid and hubs moved up and down alone."""
    car = LinearCar()
    speeds = []
    for c, hub in zip(CORNERS, car.hub, strict=True):
        height = hub[2] + record[f"Car.C{c}.q0"]
        along = record["Car.vx"] + record["Car.PitchVel"] * height
        up = record["Car.vz"] - record["Car.PitchVel"] * hub[0] + record[f"Car.C{c}.q0p"]
        slope = np.gradient(record[f"Car.zRoad{c}"], H) / record["Car.vx"] + record["Car.Pitch"]
        speeds.append(along * np.cos(slope) + up * np.sin(slope))
    scale = record.corners("Car.v@")[0] / record["Car.vx"][0]
    carrier = parameter("Wheel.KinematicRadius") * record["Car.PitchVel"][:, None]
    return np.asarray(np.column_stack(speeds) * scale - carrier)


def coupling(road: str, *off: str) -> Array:
    """Return the rms of the wheel speeds' deviation from rigid rolling [m/s], shape (4,)."""
    start: dict[str, Value] = {"Init.Velocity": 10.0, "Road.File": road, "Damp.Passive": True}
    for name in off:
        start |= COUPLINGS[name]
    record = run(2.0, start, h=H)
    deviation = (record.corners("Car.v@") - rigid_wheel_speed(record))[400:]
    return np.asarray(deviation.std(axis=0))


def test_vertical_motion_shows_in_the_wheel_speeds(swell: str) -> None:
    full, none = coupling(swell), coupling(swell, *COUPLINGS)
    assert (full > 0.015).all()
    assert (none < 0.1 * full).all()  # without the three terms the wheels roll as rigid ones do


@pytest.mark.parametrize("term", list(COUPLINGS))
def test_each_term_has_its_share(swell: str, term: str) -> None:
    none = coupling(swell, *COUPLINGS)
    alone = coupling(swell, *(n for n in COUPLINGS if n != term))
    assert (alone > 3.0 * none).all()
    assert (alone > 0.005).all()


def test_wheel_speed_is_rotation_times_constant_radius(swell: str) -> None:
    record = run(2.0, {"Init.Velocity": 10.0, "Road.File": swell})
    spins = record.corners("Car.WheelSpd_@")
    assert record.corners("Car.v@") == pytest.approx(0.358 * spins, rel=1e-12)
