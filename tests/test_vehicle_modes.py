"""The vehicle's small motions against an independent linearisation: rest, modes, response.

On a road without grip the car is a holonomic system of which `vehicle_linear` writes down energy
and inertia from the parameters alone; the FMU has to move as its eigenvalues say.
"""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from gates import at_most, between, gate
from vehicle_grip import GripCar
from vehicle_linear import PITCH, ROLL, SIDE, TRAVEL, LinearCar, Y, Z, per_corner
from vehicle_rig import (
    CORNERS,
    NO_DRAG,
    NO_GRIP,
    NO_KINEMATICS,
    Array,
    G,
    Record,
    Rig,
    cosine_bump,
    each,
    linear_dampers,
    parameter,
    run,
    straight_road,
)

from cosim.fmi import Value
from cosim.road.track import DS

REST, RESPONSE = "Rest and small motions", "Frequency responses"
TWO_SIDES = np.array([-4.5, -0.3, 0.3, 4.5])  # columns of a road with a left and a right half


def modes_hz(kinematics: bool = True) -> Array:
    return np.asarray(LinearCar(kinematics=kinematics).eigenvalues().imag / (2.0 * np.pi))


# ---------------------------------------------------------------- rest


def test_static_wheel_loads() -> None:
    with Rig() as rig:
        loads = [rig[f"Car.Fz{c}"] for c in CORNERS]
        travels = [rig[f"Car.C{c}.q0"] for c in CORNERS]
    printed = np.array([5770.0, 5300.0, 6717.0, 6170.0])
    off = np.abs(loads - printed)
    gate(REST, "static wheel loads FL FR RL RR, error [N]", "Table 1 of the study", off, at_most(1))
    assert loads == pytest.approx(LinearCar().loads, abs=1e-3)
    gate(REST, "wheel travels at rest, largest [m]", "0", np.abs(travels).max(), at_most(1e-9))
    assert np.abs(LinearCar().gradient()).max() < 1e-3  # the linear model rests there too [N, N m]


@pytest.mark.parametrize("speed", [0.0, 1.0, 10.0, 25.0, 45.0])
def test_starts_in_equilibrium(speed: float) -> None:
    with Rig({"Init.Velocity": speed}) as rig:
        accelerations = [rig[f"Car.a{axis}"] for axis in "xyz"]
        rates = [rig[f"Car.{n}"] for n in ("RollVel", "PitchVel", "YawRate")]
        travel_rates = [rig[f"Car.C{c}.q0p"] for c in CORNERS]
        assert np.hypot(rig["Car.vx"], rig["Car.vz"]) == pytest.approx(speed, abs=1e-6)
        # the ground carries what the air does not: lift, and drag along the pitched body
        air = 0.5 * 1.2 * 2.6 * speed**2
        carried = parameter("Body.Mass") * G - air * (0.05 + 0.08 + 0.35 * rig["Car.Pitch"])
        assert sum(rig[f"Car.Fz{c}"] for c in CORNERS) == pytest.approx(carried, abs=0.1)
    largest = float(np.abs(accelerations).max())
    gate(REST, f"start at {speed:g} m/s: largest acceleration [m/s2]", "0", largest, at_most(1e-5))
    assert np.abs(rates).max() == 0.0
    assert np.abs(travel_rates).max() == 0.0


# ---------------------------------------------------------------- eigenfrequencies


def matrix_pencil(signals: Array, dt: float, order: int, window: int) -> Array:
    """Continuous-time poles [1/s] of free responses, shape (n, signals) (Hua & Sarkar 1990)."""
    count = len(signals) - window
    hankel = np.vstack([[y[i : i + window + 1] for i in range(count)] for y in signals.T])
    right = np.linalg.svd(hankel, full_matrices=False)[2][:order].T
    return np.asarray(np.log(np.linalg.eigvals(np.linalg.pinv(right[:-1]) @ right[1:])) / dt)


def free_response(folder: Path, kinematics: bool) -> Record:
    """The undamped car behind small bumps that wake all modes."""

    def bumps(s: Array, v: Array) -> Array:
        left, right = v > 0.0, v < 0.0
        short, long = cosine_bump(s, 5.0, 1.0, 0.0004), cosine_bump(s, 5.0, 7.0, 0.0008)
        return cosine_bump(s, 5.0, 3.0, 0.0008) + short * left + long * right

    road = straight_road(folder / "bumps.crg", bumps, columns=TWO_SIDES, length=200.0)
    start: dict[str, Value] = {
        "Init.Velocity": 10.0, "Init.x": -5.0, "Road.File": road, "Solver.Step": 0.25e-3,
        "Tire.Damping": 0.0, **each("Damp.Scale@", 0.0), **NO_GRIP, **NO_DRAG,
    }  # fmt: skip
    return run(14.0, start if kinematics else {**start, **NO_KINEMATICS})


@pytest.mark.parametrize("kinematics", [True, False])
def test_eigenfrequencies(tmp_path: Path, kinematics: bool) -> None:
    record = free_response(tmp_path, kinematics)
    poles = matrix_pencil(record.corners("Car.C@.q0p")[400:], 0.01, order=14, window=120)
    found = np.sort(poles.imag[poles.imag > 0.1]) / (2.0 * np.pi)
    error = np.abs(found / modes_hz(kinematics) - 1.0)
    which = "with" if kinematics else "without"
    what = f"modes {which} kinematics: heave pitch roll, four of wheel hop, error [-]"
    gate(REST, what, "analytic linearisation (energy's Hessian)", error, at_most(1e-3))
    assert np.abs(poles.real).max() < 0.02  # nothing damps, nothing drives


def test_ride_frequencies_are_an_suvs() -> None:
    heave, pitch, roll, *hop = modes_hz()
    typical = "typical of an SUV"
    gate(REST, "heave frequency [Hz]", typical, heave, between(1.24, 1.30))
    gate(REST, "pitch frequency [Hz]", typical, pitch, between(1.52, 1.58))
    gate(REST, "roll frequency [Hz]", typical, roll, between(1.8, 2.6))
    gate(REST, "wheel hop [Hz]", "from the unsprung mass of Table 1", hop, between(14, 15.5))


# ---------------------------------------------------------------- frequency response

SPEED, PERIOD = 20.0, 20.0  # of the multisine road [m/s, s]
FREQUENCIES = np.array(
    [0.5, 0.8, 1.0, 1.15, 1.3, 1.45, 1.6, 1.8, 2.1, 2.5, 3.0, 4.0, 5.5, 7.0, 9.0, 12.5, 13.5, 14.5]
)
PHASES = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, len(FREQUENCIES))
AMPLITUDES = 0.0002 / FREQUENCIES  # [m]: the car must stay linear and not lose speed
DAMPING = (2450.0, 3250.0)
LINEAR = LinearCar(np.repeat(DAMPING, 2), parameter("Tire.Damping"))
Gains = dict[str, npt.NDArray[np.complex128]]


def multisine_run(folder: Path, antisymmetric: bool, grip: bool) -> Record:
    def elevation(s: Array, v: Array) -> Array:
        waves = AMPLITUDES * np.cos(2.0 * np.pi * FREQUENCIES / SPEED * s + PHASES)
        one_side = waves.sum(axis=1, keepdims=True) * np.clip((s + 15.0) / 20.0, 0.0, 1.0)
        return np.asarray(one_side * (np.sign(v) if antisymmetric else np.ones_like(v)))

    road = straight_road(folder / "sines.crg", elevation, columns=TWO_SIDES, length=700.0)
    start: dict[str, Value] = {
        "Init.Velocity": SPEED,
        "Init.x": -18.0,
        "Road.File": road,
        **NO_DRAG,
    }
    start |= linear_dampers(*DAMPING) | ({} if grip else NO_GRIP)
    return run(32.0, start)


def patch_gains(frequency: float) -> tuple[complex, complex]:
    """What the patch makes of a wave: gains of its mean height and of the slope fitted to it."""
    k, half = 2.0 * np.pi * frequency / SPEED, 0.5 * parameter("Road.PatchLength")
    grid = np.sinc(frequency / SPEED * DS) ** 2  # linear between the road's cross sections
    mean = np.sin(k * half) / (k * half)
    fitted = 3.0j * (mean - np.cos(k * half)) / (k * half**2)  # integrals of s exp(iks) and s^2
    return complex(grid * mean), complex(grid * fitted)


def gains(record: Record, names: dict[str, int], car: LinearCar | GripCar, side: Array) -> Gains:
    """Measured over analytic complex amplitudes, shape (frequencies,) for each name.

    `names` maps outputs to coordinates of p; `side` (4,) is the sign of the road under each wheel.
    """
    window = slice(-round(PERIOD / 0.01) - 1, -1)
    t, x0 = record.t[window], record["Car.tx"][window][0]
    out: dict[str, list[complex]] = {name: [] for name in names}
    for f, amplitude, phase in zip(FREQUENCIES, AMPLITUDES, PHASES, strict=True):
        omega = 2.0 * np.pi * f
        start = omega / SPEED * (x0 - SPEED * t[0] + LINEAR.hub[:, 0]) + phase
        road = amplitude * np.exp(1j * start) * side
        height, slope = patch_gains(f)
        p = car.response(omega, road * height, road * slope)
        for name, index in names.items():
            measured = 2.0 * np.mean(record[name][window] * np.exp(-1j * omega * t))
            order = 2 if name in ("Car.ay", "Car.az") else 1
            out[name].append(complex(measured / (p[index] * (1j * omega) ** order)))
    return {name: np.array(values) for name, values in out.items()}


TRAVELS = {f"Car.C{c}.q0p": TRAVEL + i for i, c in enumerate(CORNERS)}


SYMMETRIC = {"Car.az": Z, "Car.PitchVel": PITCH} | TRAVELS


def enter(grip: str, road: str, ratios: Gains, most: float) -> None:
    errors = {name: float(np.abs(ratio - 1.0).max()) for name, ratio in ratios.items()}
    own = [name for name in errors if name not in TRAVELS]
    names = ", ".join([*own, "four travel rates"])
    check = f"driven over sines, {grip}, {road}: {names}: complex gain 0.5 to 14.5 Hz, error [-]"
    measured = [errors[n] for n in own] + [max(errors[n] for n in TRAVELS)]
    gate(RESPONSE, check, "analytic linearisation", measured, at_most(most))


def test_heave_and_pitch_response(tmp_path: Path) -> None:
    record = multisine_run(tmp_path, antisymmetric=False, grip=False)
    ratios = gains(record, SYMMETRIC, LINEAR, np.ones(4))
    enter("no grip", "both sides", ratios, 0.01)


def test_roll_response(tmp_path: Path) -> None:
    record = multisine_run(tmp_path, antisymmetric=True, grip=False)
    ratios = gains(record, {"Car.RollVel": ROLL} | TRAVELS, LINEAR, SIDE)
    enter("no grip", "left against right", ratios, 0.012)


def test_heave_and_pitch_response_with_grip(tmp_path: Path) -> None:
    """Longitudinal grip, which the linear car leaves out, ties pitch to the wheels' inertia."""
    record = multisine_run(tmp_path, antisymmetric=False, grip=True)
    ratios = gains(record, TRAVELS, GripCar(LINEAR, SPEED), np.ones(4))
    enter("grip", "both sides", ratios, 0.03)


def test_roll_response_with_grip(tmp_path: Path) -> None:
    """Tyres that hold the car sideways change the roll altogether: less than half at 2.1 Hz."""
    record = multisine_run(tmp_path, antisymmetric=True, grip=True)
    names = {"Car.RollVel": ROLL, "Car.ay": Y} | TRAVELS
    ratios = gains(record, names, GripCar(LINEAR, SPEED), SIDE)
    enter("grip", "left against right", ratios, 0.025)


def test_roll_stiffness_share() -> None:
    rates = per_corner("Susp.WheelRate@")
    track = LinearCar().track
    front = rates[0] * track**2 / 2.0 + parameter("Susp.AntiRollFront")
    rear = rates[2] * track**2 / 2.0 + parameter("Susp.AntiRollRear")
    assert front / (front + rear) == pytest.approx(0.53, abs=0.01)
