"""Steering, braking and driving: signs, steady cornering against the linearisation, limits."""

from functools import cache

import numpy as np
import pytest
from gates import at_most, between, gate
from vehicle_grip import cornering_stiffness, pneumatic_trail
from vehicle_linear import ROLL, SIDE, TRAVEL, LinearCar, per_corner
from vehicle_rig import (
    BRAKE,
    GAS,
    STEER,
    Array,
    Cruise,
    G,
    Record,
    Rig,
    parameter,
    run,
    steer_to,
)

STEADY = "Steady cornering"
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
    off = abs(total / np.degrees(G * analytic[ROLL]) - 1.0)
    gate(STEADY, "roll gradient [deg/g]", "6.0 to 7 typical of an SUV", total, between(6.0, 7.0))
    gate(STEADY, "roll gradient, error [-]", "analytic linearisation", off, at_most(0.015))
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
    p, stiffness, trail = (
        car.steady_turn(),
        cornering_stiffness(car.loads),
        pneumatic_trail(car.loads),
    )
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


def extra_steer(record: Record) -> Array:
    """Hand wheel over ratio less the Ackermann angle [rad]."""
    wheelbase = parameter("Body.CogToFront") + parameter("Body.CogToRear")
    hand = record["Steer.WhlAng"] / parameter("Steer.Ratio")
    return np.asarray(hand - wheelbase * record["Car.YawRate"] / record["Car.vx"])


def test_understeer_gradient() -> None:
    slow, limit = slow_ramp(27.0, 2.0, 15.0), slow_ramp(22.2, 8.0, 25.0)
    at_first = slope(slow, extra_steer(slow), 0.2, 0.8)
    off = abs(at_first / understeer_gradient() - 1.0)
    gate(STEADY, "understeer gradient below 0.8 m/s2, error [-]", "analytic", off, at_most(0.08))
    everyday, late = (
        np.degrees(G * slope(record, extra_steer(record), low, high))  # [deg/g]
        for record, low, high in ((slow, 1.0, 4.0), (limit, 5.0, 6.0))
    )
    both = np.array([everyday, late])
    check = "ISO 4138, constant speed: understeer gradient at 1 to 4 and 5 to 6 m/s2 [deg/g]"
    gate(STEADY, check, "1.5 to 4, typical of the class", both, between(1.5, 4.0))
    assert everyday < late


def test_largest_lateral_acceleration() -> None:
    record = slow_ramp(22.2, 8.0, 25.0)
    largest = float(record["Car.ay"].max() / G)
    oracle = "0.80 to 0.85 for a static stability factor of 1.25"
    gate(STEADY, "largest lateral acceleration [g]", oracle, largest, between(0.80, 0.85))
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
