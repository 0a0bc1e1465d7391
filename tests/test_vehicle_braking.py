"""Braking and driving: anti-dive, load transfer, slip control, friction."""

import numpy as np
import pytest
from gates import at_most, between, gate
from vehicle_linear import LinearCar
from vehicle_rig import (
    BRAKE,
    FRICTION,
    GAS,
    Array,
    Drive,
    G,
    Record,
    Rig,
    each,
    parameter,
    run,
)

from cosim.fmi import Value

FRONT, REAR = slice(0, 2), slice(2, 4)
SECTION, DESIGN = "Braking and driving", "design value (docs/vehicle.md)"


def from_rest(record: Record, name: str) -> Array:
    values = record.corners(name) if "@" in name else record[name]
    return np.asarray(values - values[0])


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
    check = "anti-dive at 0.5 g: share of the front travel that the kinematics take [%]"
    gate(SECTION, check, DESIGN, 100.0 * less[FRONT], between(19.0, 31.0))
    check = "anti-lift at 0.5 g: share of the rear travel that the kinematics take [%]"
    gate(SECTION, check, DESIGN, 100.0 * less[REAR], between(29.0, 41.0))


def test_anti_squat() -> None:
    start: dict[str, Value] = {"Init.Velocity": 10.0}
    with_kinematics = settled(start, pedal(GAS, 0.6))
    without = settled(start | NO_ANTIS, pedal(GAS, 0.6))
    less = 1.0 - with_kinematics[2] / without[2]
    check = "anti-squat: share of the rear travel that the kinematics take [%]"
    gate(SECTION, check, DESIGN, 100.0 * less[REAR], between(24.0, 36.0))
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
    off = abs(front / (-force * lever / wheelbase) - 1.0)
    check = "braking at 0.5 g: load transfer to the front, error [-]"
    gate(SECTION, check, "brake force, its lever, wheelbase", float(off), at_most(0.05))


@pytest.mark.parametrize("active", [True, False])
def test_slip_control(active: bool) -> None:
    def drive(rig: Rig) -> None:
        rig.inputs[BRAKE], rig.inputs[FRICTION] = 1.0, 0.3

    start: dict[str, Value] = {
        "Init.Velocity": 20.0,
        "SlipControl.Active": active,
        "Road.Friction": 0.3,
    }
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
    check = "full braking at 108 km/h: deceleration [g]"
    gate(SECTION, check, "0.8 to 1.15, typical of passenger cars", full, between(0.8, 1.15))
    assert half == pytest.approx(0.5 * full, rel=0.25)
    assert fifth == pytest.approx(0.2 * full, rel=0.4)
