"""Steering, braking and driving: signs, steady cornering against the linearisation, limits."""

from functools import cache

import numpy as np
import pytest
from vehicle_linear import ROLL, SIDE, TRAVEL, LinearCar, per_corner
from vehicle_rig import (
    BRAKE,
    FRICTION,
    GAS,
    STEER,
    Array,
    Cruise,
    Drive,
    G,
    Record,
    Rig,
    each,
    parameter,
    run,
    steer_to,
)

from cosim.fmi import Value

LEFT, RIGHT = [0, 2], [1, 3]
FRONT, REAR = slice(0, 2), slice(2, 4)


@cache
def slow_ramp(speed: float, rate: float, seconds: float) -> Record:
    """Hand wheel turned to the left at `rate` [deg/s], speed [m/s] held (as in ISO 4138)."""
    cruise = Cruise(speed)

    def drive(rig: Rig) -> None:
        cruise(rig)
        rig.inputs[STEER] = np.radians(rate) * rig.t

    return run(seconds, {"Init.Velocity": speed}, drive)


def from_rest(record: Record, name: str) -> Array:
    values = record.corners(name) if "@" in name else record[name]
    return np.asarray(values - values[0])


# ---------------------------------------------------------------- signs


def test_steering_to_the_left() -> None:
    record = run(3.0, {"Init.Velocity": 15.0}, steer_to(0.5, 0.2))
    entry, steady = slice(10, 30), slice(200, 301)
    for name in ("Car.ay", "Car.YawRate", "Car.Roll", "Car.ty", "Car.Yaw"):
        assert record[name][steady].min() > 0.0, name
    assert record["Car.RollVel"][entry].mean() > 0.01  # right side down first
    turning = record["Car.YawRate"] * record["Car.vx"]
    assert turning[steady].mean() == pytest.approx(record["Car.ay"][steady].mean(), rel=0.01)
    load = from_rest(record, "Car.Fz@")[steady].mean(axis=0)
    assert (load[RIGHT] > 800.0).all()
    assert (load[LEFT] < -800.0).all()
    travel = record.corners("Car.C@.q0")[steady].mean(axis=0)
    assert (travel[RIGHT] > 0.01).all()  # compression
    assert (travel[LEFT] < -0.01).all()
    assert (record.corners("Car.Fy@")[steady] > 500.0).all()
    assert (record.corners("Car.SlipAngle@")[steady] < 0.0).all()
    assert (record.corners("Car.Camber@")[steady] > 0.0).all()  # leaning out with the body
    front = record.corners("Car.SteerAngle@")[steady, :2]
    assert (front > 0.02).all()
    assert (front[:, 0] > front[:, 1]).all()  # Ackermann: the inner wheel turns further
    v_rel = -record.corners("Car.C@.q0p")[entry].mean(axis=0)
    assert (v_rel[LEFT] > 0.0).all()  # the left side extends
    assert (v_rel[RIGHT] < 0.0).all()


def test_braking_and_driving_signs() -> None:
    def brake(rig: Rig) -> None:
        rig.inputs[BRAKE] = 0.3

    def drive(rig: Rig) -> None:
        rig.inputs[GAS] = 0.5

    for command, sign in ((brake, 1.0), (drive, -1.0)):
        record = run(1.0, {"Init.Velocity": 15.0}, command)
        entry = slice(10, 30)
        assert sign * record["Car.ax"][entry].mean() < -1.0
        assert sign * record["Car.PitchVel"][entry].mean() > 0.01  # nose down in braking
        assert sign * record["Car.Pitch"][-1] > 0.002
        v_rel = -sign * record.corners("Car.C@.q0p")[entry].mean(axis=0)
        assert (v_rel[FRONT] < 0.0).all()  # the front compresses in braking
        assert (v_rel[REAR] > 0.0).all()
        assert (sign * record.corners("Car.Fx@")[entry].mean(axis=0) < 0.0).all()
        assert (sign * record.corners("Car.LongSlip@")[entry].mean(axis=0) < 0.0).all()
        assert abs(record["Car.Yaw"][-1]) < 0.01


# ---------------------------------------------------------------- steady cornering


def slope(record: Record, values: Array, low: float, high: float) -> float:
    """d(values)/d(ay) [1/(m/s2)] where the lateral acceleration lies in low .. high [m/s2]."""
    ay = record["Car.ay"]
    used = (ay > low) & (ay < high) & (record.t < record.t[ay.argmax()])
    return float(np.polyfit(ay[used], values[used], 1)[0])


def test_roll_gradient() -> None:
    record, analytic = slow_ramp(27.0, 4.0, 10.0), LinearCar().steady_turn()
    total = np.degrees(G * slope(record, record["Car.Roll"], 0.3, 3.0))
    assert total == pytest.approx(np.degrees(G * analytic[ROLL]), rel=0.015)
    assert total == pytest.approx(6.7, abs=0.2)
    for left, right in ((0, 1), (2, 3)):
        travel = record.corners("Car.C@.q0")
        measured = slope(record, travel[:, right] - travel[:, left], 0.3, 3.0)
        expected = analytic[TRAVEL + right] - analytic[TRAVEL + left]
        assert measured == pytest.approx(expected, rel=0.015)
        assert np.degrees(G * measured / LinearCar().track) == pytest.approx(5.0, abs=0.2)


def test_lateral_load_transfer() -> None:
    record, car = slow_ramp(27.0, 4.0, 10.0), LinearCar()
    expected = -parameter("Tire.Stiffness") * car.lift @ car.steady_turn()
    loads = record.corners("Car.Fz@")
    for left, right in ((0, 1), (2, 3)):
        measured = slope(record, (loads[:, right] - loads[:, left]) / 2.0, 0.3, 3.0)
        assert measured == pytest.approx((expected[right] - expected[left]) / 2.0, rel=0.02)


def understeer_gradient() -> float:
    """Hand wheel over ratio, less the Ackermann angle, per lateral acceleration [rad/(m/s2)].

    Slip angles from the Magic Formula's cornering stiffness, compliance of rack and bushings,
    roll steer.
    """
    car = LinearCar()
    p, load = car.steady_turn(), car.loads / parameter("Tire.NominalLoad")
    peak = 2.0 * np.arctan(load / parameter("Tire.PKY2"))
    stiffness = -parameter("Tire.PKY1") * parameter("Tire.NominalLoad") * np.sin(peak)
    trail = parameter("Tire.QDZ1") * parameter("Tire.Radius") * load
    a, b = parameter("Body.CogToFront"), parameter("Body.CogToRear")
    shift = float(trail.mean())  # the aligning moments' share in the balance about z
    axle = parameter("Body.Mass") * np.array([b + shift, a - shift]) / (a + b)
    slip = axle / stiffness.reshape(2, 2).sum(axis=1)
    force = np.repeat(slip, 2) * stiffness
    camber = p[ROLL] + SIDE * per_corner("Kin.Camber@") * p[TRAVEL:]
    caster = car.radius * per_corner("Kin.Caster@")
    moments = -force * (trail + caster) - caster * camber * car.loads
    rack = moments[FRONT].sum() / parameter("Steer.Stiffness")
    own_steer = per_corner("Kin.LateralForceSteer@") * force
    own_steer += SIDE * per_corner("Kin.BumpSteer@") * p[TRAVEL:]
    front, rear = own_steer.reshape(2, 2).mean(axis=1)
    return float(slip[0] - slip[1] - rack - front + rear)


def test_understeer_gradient() -> None:
    record = slow_ramp(27.0, 2.0, 15.0)
    wheelbase = parameter("Body.CogToFront") + parameter("Body.CogToRear")
    hand = record["Steer.WhlAng"] / parameter("Steer.Ratio")
    extra = hand - wheelbase * record["Car.YawRate"] / record["Car.vx"]
    assert slope(record, extra, 0.2, 0.8) == pytest.approx(understeer_gradient(), rel=0.08)
    everyday = np.degrees(G * slope(record, extra, 1.0, 4.0))  # [deg/g]
    assert 1.5 < everyday < 4.0
    assert np.degrees(G * slope(slow_ramp(22.2, 8.0, 25.0), _extra(22.2), 5.0, 6.0)) > everyday


def _extra(speed: float) -> Array:
    record = slow_ramp(speed, 8.0, 25.0)
    wheelbase = parameter("Body.CogToFront") + parameter("Body.CogToRear")
    hand = record["Steer.WhlAng"] / parameter("Steer.Ratio")
    return np.asarray(hand - wheelbase * record["Car.YawRate"] / record["Car.vx"])


def test_largest_lateral_acceleration() -> None:
    record = slow_ramp(22.2, 8.0, 25.0)
    assert 0.80 < record["Car.ay"].max() / G < 0.86
    assert record["Car.ay"][-1] > 0.9 * record["Car.ay"].max()  # it pushes wide; it does not spin
    assert np.abs(record["Car.SideSlipAngle"]).max() < np.radians(8.0)


def test_tyres_carry_the_lateral_acceleration() -> None:
    """Newton's second law across a steady turn, tyre forces turned into body axes."""
    record = run(6.0, {"Init.Velocity": 20.0}, steer_to(0.6, 0.5))
    steer = record.corners("Car.SteerAngle@")
    fx, fy = record.corners("Car.Fx@"), record.corners("Car.Fy@")
    force = (fy * np.cos(steer) + fx * np.sin(steer)).sum(axis=1)
    needed = parameter("Body.Mass") * record["Car.ay"] * np.cos(record["Car.Roll"])
    assert force[500:] == pytest.approx(needed[500:], rel=0.005)


# ---------------------------------------------------------------- braking and driving


NO_ANTIS: dict[str, Value] = {
    k: v
    for name in ("Recession", "RecessionCurve", "KnucklePitch")
    for k, v in each(f"Kin.{name}@", 0.0).items()
}


def pedal(index: int, value: float) -> Drive:
    def drive(rig: Rig) -> None:
        rig.inputs[index] = value if rig.k >= 50 else 0.0

    return drive


def settled(start: dict[str, Value], command: Drive) -> tuple[float, float, Array]:
    """Mean ax [g], and pitch [rad] and travels [m] over those of straight running, settled."""
    record = run(2.8, {"Damp.Passive": True, **start}, command)
    window = slice(200, 281)
    pitch, travel = from_rest(record, "Car.Pitch"), from_rest(record, "Car.C@.q0")
    return (
        float(record["Car.ax"][window].mean() / G),
        float(pitch[window].mean()),
        np.asarray(travel[window].mean(axis=0)),
    )


def test_anti_dive_and_anti_lift() -> None:
    start: dict[str, Value] = {"Init.Velocity": 25.0}
    with_kinematics = settled(start, pedal(BRAKE, 0.43))
    without = settled(start | NO_ANTIS, pedal(BRAKE, 0.43))
    assert with_kinematics[0] == pytest.approx(-0.5, abs=0.02)
    assert without[0] == pytest.approx(with_kinematics[0], rel=0.01)
    assert 0.7 < with_kinematics[1] / without[1] < 0.85  # nose down, but less
    assert without[1] > np.radians(1.0)
    less = 1.0 - with_kinematics[2] / without[2]
    assert less[FRONT] == pytest.approx([0.25] * 2, abs=0.06)  # the design's 25 and 35 %
    assert less[REAR] == pytest.approx([0.35] * 2, abs=0.06)


def test_anti_squat() -> None:
    start: dict[str, Value] = {"Init.Velocity": 10.0}
    with_kinematics = settled(start, pedal(GAS, 0.6))
    without = settled(start | NO_ANTIS, pedal(GAS, 0.6))
    less = 1.0 - with_kinematics[2] / without[2]
    assert less[REAR] == pytest.approx([0.30] * 2, abs=0.06)
    assert with_kinematics[1] < 0.0  # nose up


def test_longitudinal_load_transfer() -> None:
    """The tyres' forces act on the body a little below the road: by rolling less loaded radius."""
    record = run(2.8, {"Init.Velocity": 25.0, "Damp.Passive": True}, pedal(BRAKE, 0.43))
    window = slice(200, 281)
    front = from_rest(record, "Car.Fz@")[window, FRONT].sum(axis=1).mean()
    wheelbase = parameter("Body.CogToFront") + parameter("Body.CogToRear")
    force = from_rest(record, "Car.Fx@")[window].sum(axis=1).mean()
    lever = (
        parameter("Body.CogHeight") + parameter("Wheel.KinematicRadius") - LinearCar().radius.mean()
    )
    assert front == pytest.approx(-force * lever / wheelbase, rel=0.05)


@pytest.mark.parametrize("active", [True, False])
def test_slip_control(active: bool) -> None:
    def drive(rig: Rig) -> None:
        rig.inputs[BRAKE], rig.inputs[FRICTION] = 1.0, 0.3

    start = {"Init.Velocity": 20.0, "SlipControl.Active": active, "Road.Friction": 0.3}
    record = run(4.0, start, drive)
    assert np.isfinite(record.rows).all()
    rolling = record["Car.vx"] > 10.0
    slip = record.corners("Car.LongSlip@")[rolling][50:]
    if active:
        assert slip.min() > -0.5
        assert (record.corners("Car.WheelSpd_@")[rolling] > 5.0).all()
    else:
        assert (slip.min(axis=0) < -0.99).all()  # locked
        assert np.abs(record.corners("Car.WheelSpd_@")[150]).max() < 1.0
    assert record["Car.ax"].min() / G > -0.3 * 1.3  # no more than the road gives


def test_slip_control_stops_shorter() -> None:
    def drive(rig: Rig) -> None:
        rig.inputs[BRAKE], rig.inputs[FRICTION] = 1.0, 0.3

    runs = [
        run(4.0, {"Init.Velocity": 20.0, "SlipControl.Active": on, "Road.Friction": 0.3}, drive)
        for on in (True, False)
    ]
    assert runs[0]["Car.vx"][-1] < runs[1]["Car.vx"][-1] - 2.0


def test_full_throttle_spins_without_slip_control() -> None:
    def drive(rig: Rig) -> None:
        rig.inputs[GAS], rig.inputs[FRICTION] = 1.0, 0.3

    start: dict[str, Value] = {"Init.Velocity": 15.0, "Road.Friction": 0.3}
    held = run(2.0, start, drive).corners("Car.LongSlip@").max()
    spun = run(2.0, {**start, "SlipControl.Active": False}, drive).corners("Car.LongSlip@").max()
    assert held < 0.35
    assert spun > 0.9


def test_friction_scales_the_limit() -> None:
    def drive(rig: Rig) -> None:
        rig.inputs[BRAKE] = 1.0
        rig.inputs[FRICTION] = rough

    decelerations = []
    for rough in (1.0, 0.5, 0.2):
        record = run(1.5, {"Init.Velocity": 30.0, "Road.Friction": rough}, drive)
        decelerations.append(float(-record["Car.ax"][50:150].mean() / G))
    full, half, fifth = decelerations
    assert 0.8 < full < 1.15
    assert half == pytest.approx(0.5 * full, rel=0.25)
    assert fifth == pytest.approx(0.2 * full, rel=0.4)
