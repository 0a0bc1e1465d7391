"""Laws that the vehicle FMU must keep in every manoeuvre: symmetry, convergence, energy, rest."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from gates import at_most, gate
from vehicle_rig import (
    BRAKE,
    CENTRED,
    DAMPERS,
    GAS,
    STEER,
    Array,
    G,
    Record,
    Rig,
    cosine_bump,
    output_names,
    parameter,
    run,
    straight_road,
    straight_track,
)

from cosim.fmi import Value
from cosim.road import Iso8608, build_road

LAWS = "Energy, symmetry, rest"
RATES = np.array([1.0, 1.3, 1.7, 2.1])  # of the four damper commands [Hz]


@pytest.fixture(scope="module")
def rough(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], str]:
    """Road files of 100 m with an ISO 8608 class."""
    folder = tmp_path_factory.mktemp("roads")
    return lambda kind: str(build_road(straight_track(100.0), Iso8608(kind, 3), folder))


def slalom(rig: Rig) -> None:
    rig.inputs[GAS] = 0.05
    rig.inputs[STEER] = np.sin(np.pi * rig.t)
    rig.inputs[DAMPERS] = 0.5 + 0.5 * np.sin(2.0 * np.pi * RATES * rig.t)


# ---------------------------------------------------------------- left and right

SWAPPED = [1, 0, 3, 2]
EVEN = (
    "Car.ax", "Car.az", "Car.PitchVel", "Car.vx", "Car.vz", "Car.tx", "Car.tz", "Car.Pitch",
    "Car.Road.sRoad", "Sensor.Imu.ax", "Sensor.Imu.az", "Sensor.Imu.PitchVel", "Sensor.Esc.vx",
    "Energy.Stored", "Energy.Dissipated", "Energy.Supplied",
)  # fmt: skip
ODD = (
    "Car.ay", "Car.RollVel", "Car.YawRate", "Car.vy", "Car.ty", "Car.Roll", "Car.Yaw",
    "Car.SideSlipAngle", "Car.Road.tRoad", "Sensor.Imu.ay", "Sensor.Imu.RollVel", "Steer.WhlAng",
)  # fmt: skip
EVEN_CORNERS = (
    "Car.Fz@", "Car.Fx@", "Car.C@.q0", "Car.C@.q0p", "Car.WheelSpd_@", "Car.LongSlip@",
    "Car.Damp@.Frc", "Car.zRoad@", "PT.Motor@.Trq", "Brake.Trq@",
)  # fmt: skip
ODD_CORNERS = ("Car.Fy@", "Car.SteerAngle@", "Car.SlipAngle@", "Car.Camber@")


def mirror_run(folder: Path, sign: float) -> Record:
    """Slalom, gas, brake and one-sided bumps; `sign` -1 swaps left and right."""

    def elevation(s: Array, v: Array) -> Array:
        left, right = sign * v > 0.1, sign * v < -0.1
        ramp = left * np.clip(sign * v / 1.2, 0.0, 1.0)
        first = cosine_bump(s, 5.0, 0.6, 0.03) * left + cosine_bump(s, 8.0, 0.4, 0.02) * right
        return first + cosine_bump(s, 12.0, 2.0, 0.05) * ramp

    def drive(rig: Rig) -> None:
        rig.inputs[STEER] = sign * 1.2 * np.sin(2.0 * np.pi * 0.7 * rig.t)
        rig.inputs[GAS] = 0.2 if rig.t < 2.0 else 0.0
        rig.inputs[BRAKE] = 0.3 if 2.5 < rig.t < 3.2 else 0.0
        commands = np.array([0.2, 0.7, 0.4, 0.9])
        rig.inputs[DAMPERS] = commands if sign > 0.0 else commands[SWAPPED]

    columns = np.array([-4.5, -2.0, -1.2, -0.4, 0.4, 1.2, 2.0, 4.5])
    road = straight_road(folder / f"mirror{sign:g}.crg", elevation, columns=columns)
    return run(5.0, {**CENTRED, "Init.Velocity": 12.0, "Road.File": road}, drive)


def test_mirror_symmetry(tmp_path: Path) -> None:
    left, right = mirror_run(tmp_path, 1.0), mirror_run(tmp_path, -1.0)
    loads = left.corners("Car.Fz@"), right.corners("Car.Fz@")[:, SWAPPED]
    off = float(np.abs(loads[0] - loads[1]).max() / loads[0].max())
    check = "mirror symmetry over bumps, steering, pedals, dampers: wheel loads, error [-]"
    gate(LAWS, check, "0", off, at_most(1e-9))
    for names, sign in ((EVEN, 1.0), (ODD, -1.0)):
        for name in names:
            a, b = left[name], sign * right[name]
            assert np.abs(a - b).max() < 1e-9 * max(1.0, np.abs(a).max()), name
    for patterns, sign in ((EVEN_CORNERS, 1.0), (ODD_CORNERS, -1.0)):
        for name in patterns:
            a, b = left.corners(name), sign * right.corners(name)[:, SWAPPED]
            assert np.abs(a - b).max() < 1e-9 * max(1.0, np.abs(a).max()), name


def test_symmetric_car_runs_straight() -> None:
    record = run(5.0, {**CENTRED, "Init.Velocity": 30.0})
    assert np.abs(record["Car.ty"]).max() < 1e-7
    assert np.abs(record["Car.Yaw"]).max() < 1e-9


# ---------------------------------------------------------------- convergence


def test_step_halving(rough: Callable[[str], str]) -> None:
    """Errors fall with the square of the step; at the default 1 ms v_rel is right to 1 %."""

    def at(step: float) -> Record:
        start: dict[str, Value] = {
            "Init.Velocity": 12.0,
            "Road.File": rough("B"),
            "Solver.Step": step,
        }
        return run(6.0, start, slalom)

    exact = at(6.25e-5)
    steps = [0.25e-3, 0.5e-3, 1e-3]
    runs = [at(step) for step in steps]

    def errors(name: str) -> list[float]:
        truth = exact.corners(name)[100:]
        spread = np.sqrt(truth.var(axis=0).mean())
        return [
            float(np.sqrt(np.mean((r.corners(name)[100:] - truth) ** 2)) / spread) for r in runs
        ]

    for name, at_default in (("Car.C@.q0p", 0.01), ("Car.Fz@", 0.003), ("Car.v@", 0.002)):
        fine, middle, default = errors(name)
        check = f"class B slalom at 12 m/s, {name}: rms error at 1 ms over rms [-]"
        gate("Solver", check, "0.0625 ms", default, at_most(at_default))
        assert default > 3.0 * middle > 9.0 * fine, name
    for name in ("Car.ax", "Car.ay", "Car.az", "Car.RollVel", "Car.PitchVel", "Car.YawRate"):
        fine, _, default = errors(name) if "@" in name else channel_errors(exact, runs, name)
        assert default < 0.02, name
        assert fine < 0.001, name


def channel_errors(exact: Record, runs: list[Record], name: str) -> list[float]:
    truth = exact[name][100:]
    return [float(np.sqrt(np.mean((r[name][100:] - truth) ** 2)) / truth.std()) for r in runs]


# ---------------------------------------------------------------- energy


def energy_error(record: Record) -> float:
    """Largest change of stored + dissipated - supplied over the energy dissipated."""
    balance = record["Energy.Stored"] + record["Energy.Dissipated"] - record["Energy.Supplied"]
    return float(np.abs(balance - balance[0]).max() / record["Energy.Dissipated"][-1])


def test_energy_balance_on_the_flat() -> None:
    coast = run(8.0, {"Init.Velocity": 20.0, "Damp.Passive": True})
    assert coast["Energy.Dissipated"][-1] > 5e4
    check = "flat coast-down: energy imbalance over the energy dissipated [-]"
    gate(LAWS, check, "0", energy_error(coast), at_most(1e-6))


def test_energy_balance_with_motors_brakes_and_steering() -> None:
    def drive(rig: Rig) -> None:
        slalom(rig)
        rig.inputs[GAS] = 0.3 if rig.t < 2.0 else 0.0
        rig.inputs[BRAKE] = 0.3 if rig.t > 3.0 else 0.0

    record = run(9.0, {"Init.Velocity": 15.0}, drive)
    assert record["Energy.Supplied"][-1] > 5e4
    assert record["Car.vx"][-1] < 1.0
    check = "motors, brakes and steering: energy imbalance over the energy dissipated [-]"
    gate(LAWS, check, "0", energy_error(record), at_most(2e-5))


def test_energy_balance_over_bumps(tmp_path: Path, rough: Callable[[str], str]) -> None:
    """Some joules are left: the patch's fitted slope is not quite the derivative of its mean."""

    def bumps(s: Array, v: Array) -> Array:
        left = cosine_bump(s, 5.0, 0.6, 0.03) * (v > 0.0)
        right = cosine_bump(s, 20.0, 0.6, 0.03) * (v < 0.0)
        return left + right + cosine_bump(s, 40.0, 2.0, 0.06)

    columns = np.array([-4.5, -0.1, 0.1, 4.5])
    road = straight_road(tmp_path / "bumps.crg", bumps, columns=columns, length=200.0)
    for what, file in (("bumps", road), ("class C", rough("C"))):
        record = run(6.0, {"Init.Velocity": 15.0, "Road.File": file, "Damp.Passive": True})
        check = f"{what}: energy imbalance over the energy dissipated [-]"
        gate(LAWS, check, "0", energy_error(record), at_most(2e-3))


# ---------------------------------------------------------------- rest on a hill

GRADE = 0.1


@pytest.fixture(scope="module")
def hill(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("hill") / "hill.crg"
    return straight_road(path, lambda s, v: 0.0 * s * v, length=200.0, grade=GRADE)


@pytest.mark.parametrize("brake", [0.15, 0.4])
def test_stands_on_a_hill_and_rolls_when_let_go(hill: str, brake: float) -> None:
    def drive(rig: Rig) -> None:
        rig.inputs[BRAKE] = brake if rig.k < 3000 else 0.0

    start: dict[str, Value] = {"Init.x": 50.0, "Road.File": hill, "DM.Brake": brake}
    record = run(33.0, start, drive)
    held = slice(0, 3001)
    moved = float(max(np.ptp(record[name][held]) for name in ("Car.tx", "Car.ty", "Car.tz")))
    check = f"10 % grade, brake pedal {brake:g} held for 30 s: motion [m]"
    gate(LAWS, check, "0", moved, at_most(1e-7))
    assert np.abs(record["Car.vx"][2000:3001]).max() < 1e-9
    assert np.abs(record.corners("Car.WheelSpd_@")[2000:3001]).max() < 1e-9
    # downhill force less rolling resistance, over the mass and what turns with the wheels
    angle, mass = np.arctan(GRADE), parameter("Body.Mass")
    rolling = parameter("Wheel.KinematicRadius")
    rotor = parameter("PT.RotorInertia") * parameter("PT.GearRatio") ** 2
    inertia = mass + 4.0 * (parameter("Wheel.Inertia") + rotor) / rolling**2
    resistance = parameter("Tire.QSY1") * parameter("Tire.Radius") / rolling
    force = mass * G * (np.sin(angle) - resistance * np.cos(angle))
    mean = (record["Car.vx"][3250] - record["Car.vx"][3100]) / 1.5
    off = abs(mean / (-force / inertia) - 1.0)
    check = f"10 % grade, brake pedal {brake:g} released: acceleration, error [-]"
    gate(LAWS, check, "weight, rolling resistance, inertias", off, at_most(0.003))


def test_rests_on_the_level_for_ever() -> None:
    record = run(10.0)
    assert np.abs(record.rows[-1] - record.rows[0])[output_names().index("Car.tx")] == 0.0
    assert np.abs(record["Car.vx"]).max() < 1e-12


def test_comes_to_a_stop() -> None:
    def drive(rig: Rig) -> None:
        rig.inputs[BRAKE] = 0.4

    record = run(12.0, {"Init.Velocity": 10.0, "Damp.Passive": True}, drive)
    rest = slice(600, None)
    assert np.abs(record["Car.vx"][rest]).max() < 2e-4
    assert np.ptp(record["Car.tx"][rest]) < 1e-4
    assert np.abs(record.corners("Car.WheelSpd_@")[-1]).max() < 1e-4
    assert record["Car.tx"][-1] == pytest.approx(10.0**2 / (2.0 * 4.55), rel=0.1)


# ---------------------------------------------------------------- sameness and consistency


def test_same_bits_from_both_fmi_versions_and_from_two_instances(
    rough: Callable[[str], str],
) -> None:
    start: dict[str, Value] = {"Init.Velocity": 12.0, "Road.File": rough("C")}
    alone = run(5.0, start, slalom)
    assert np.array_equal(alone.rows, run(5.0, start, slalom, version=2).rows)
    with Rig(start) as first, Rig(start, version=2) as second:
        for k in range(500):
            slalom(first)
            slalom(second)
            first.step()
            second.step()
            assert np.array_equal(first.outputs, alone.rows[k + 1])
            assert np.array_equal(second.outputs, alone.rows[k + 1])


FINE = 0.25e-3  # communication step at which the trapezoidal rule is exact enough [s]


def test_accelerations_are_the_derivatives_of_the_velocities(rough: Callable[[str], str]) -> None:
    """Car.ax .. az belong to the point whose velocity is Car.vx .. vz: dv/dt = a - omega x v."""
    record = run(3.0, {"Init.Velocity": 12.0, "Road.File": rough("B")}, slalom, h=FINE)
    stack = {
        kind: np.column_stack([record[f"Car.{n}"] for n in names])
        for kind, names in {
            "a": ("ax", "ay", "az"), "v": ("vx", "vy", "vz"),
            "omega": ("RollVel", "PitchVel", "YawRate"),
        }.items()
    }  # fmt: skip
    rate = stack["a"] - np.cross(stack["omega"], stack["v"])
    gained = np.cumsum(0.5 * (rate[1:] + rate[:-1]) * FINE, axis=0)
    assert np.abs(stack["v"][1:] - stack["v"][0] - gained).max() < 5e-5


def test_travel_rate_is_the_derivative_of_the_travel(rough: Callable[[str], str]) -> None:
    record = run(3.0, {"Init.Velocity": 12.0, "Road.File": rough("B")}, slalom, h=FINE)
    rate = record.corners("Car.C@.q0p")
    travel = record.corners("Car.C@.q0")
    gained = np.cumsum(0.5 * (rate[1:] + rate[:-1]) * FINE, axis=0)
    assert np.abs(travel[1:] - travel[0] - gained).max() < 2e-6
    paper = record.corners("Car.PaperRelVel@")
    tilt = record["Car.vx"][:, None] * np.sin(np.radians(0.45))
    assert np.abs(paper - (tilt - rate)).max() < 1e-12
