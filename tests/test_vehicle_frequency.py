"""Frequency responses 0.1 to 25 Hz: the FMU's own linearisation against analytic ones.

The FMU is linearised by finite differences on its saved state (cosim.linearise), python-control
evaluates it; the analytic car (`vehicle_linear`) knows the parameters alone, and the quarter car is
the textbook's.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import control
import numpy as np
import numpy.typing as npt
import pytest
from gates import at_most, gate
from validation_plots import picture
from vehicle_linear import PITCH, ROLL, SIDE, TRAVEL, LinearCar, Z
from vehicle_rig import (
    CORNERS,
    NO_DRAG,
    NO_GRIP,
    NO_KINEMATICS,
    Array,
    description,
    each,
    linear_dampers,
    parameter,
)

from cosim.fmi import Value
from cosim.linearise import LinearModel, linearise_on_road

Complex = npt.NDArray[np.complex128]
RESPONSE = "Frequency responses"
SPEED = 20.0  # [m/s]
DAMPING = (2450.0, 3250.0)
FREQUENCIES = np.geomspace(0.1, 25.0, 80)
TRAVEL_RATES = tuple(f"Car.C{c}.q0p" for c in CORNERS)
# derivatives by time of the analytic car's coordinates: output -> (coordinate, order)
OUTPUTS = {"Car.az": (Z, 2), "Car.PitchVel": (PITCH, 1), "Car.RollVel": (ROLL, 1)} | {
    name: (TRAVEL + i, 1) for i, name in enumerate(TRAVEL_RATES)
}
# the road's plane under the four wheels: same sign together, and one with its slope
PATTERNS = {
    "heave": np.ones(4),
    "pitch": np.array([1.0, 1.0, -1.0, -1.0]),
    "roll": SIDE,
    "warp": np.array([1.0, -1.0, -1.0, 1.0]),
}


@cache
def fmu_model(grip: bool, **more: Value) -> LinearModel:
    start = {"Init.Velocity": SPEED, **NO_DRAG, **linear_dampers(*DAMPING), **more}
    start |= {} if grip else NO_GRIP
    return linearise_on_road(description(), start, {"DM.Steer.Ang": 0.0}, tuple(OUTPUTS))


IDLE = (
    *("position.x", "position.y", "attitude.z", "angle", "brake_torque", "brake_windup"),
    *("imu", "imu_rate", "dissipated", "supplied", "valve"),
)


def from_road(model: LinearModel, pattern: Array) -> dict[str, Complex]:
    """Outputs over the road's elevation, driven at SPEED, evaluated by python-control."""
    m = model.without_states(IDLE)
    height = [m.inputs.index(f"Road.z.{c}") for c in CORNERS]
    slope = [m.inputs.index(f"Road.slope.{c}") for c in CORNERS]
    omega = 2.0 * np.pi * FREQUENCIES
    B = np.column_stack([m.B[:, height] @ pattern, m.B[:, slope] @ pattern])
    D = np.column_stack([m.D[:, height] @ pattern, m.D[:, slope] @ pattern])
    gain = control.frequency_response(control.ss(m.A, B, m.C, D), omega).complex
    both = gain[:, 0] + gain[:, 1] * (1j * omega / SPEED)
    return dict(zip(m.outputs, both, strict=True))


def analytic(car: LinearCar, pattern: Array) -> dict[str, Complex]:
    omega = 2.0 * np.pi * FREQUENCIES
    p = np.array([car.response(w, pattern, 1j * w / SPEED * pattern) for w in omega])
    return {name: p[:, i] * (1j * omega) ** order for name, (i, order) in OUTPUTS.items()}


CAR = LinearCar(np.repeat(DAMPING, 2), parameter("Tire.Damping"))


@cache
def sizes() -> dict[str, Array]:
    """The largest gain to each output that any of the four roads has, frequency by frequency."""
    responses = [analytic(CAR, pattern) for pattern in PATTERNS.values()]
    return {name: np.max([np.abs(r[name]) for r in responses], axis=0) for name in OUTPUTS}


@pytest.mark.parametrize("name", PATTERNS)
def test_fmu_linearised_is_the_analytic_car(name: str) -> None:
    found, wanted = from_road(fmu_model(False), PATTERNS[name]), analytic(CAR, PATTERNS[name])
    errors = {n: (np.abs(found[n] - wanted[n]) / sizes()[n]).max() for n in OUTPUTS}
    check = (
        f"FMU linearised, no grip: road in {name} to az, pitch, roll, travel rates, "
        "complex gain 0.1 to 25 Hz, error over the largest of heave, pitch, roll, warp [-]"
    )
    bodies = [errors[n] for n in ("Car.az", "Car.PitchVel", "Car.RollVel")]
    measured = [*bodies, max(errors[n] for n in TRAVEL_RATES)]
    gate(RESPONSE, check, "analytic linearisation, python-control", measured, at_most(5e-3))


# ---------------------------------------------------------------- the textbook's quarter car

MASS, UNSPRUNG, RATE, DAMPER = 2400.0, 140.0, 40000.0, 2800.0
QUARTER: dict[str, Value] = {
    "Body.Mass": MASS,
    "Body.UnsprungMass": UNSPRUNG,
    "Body.InertiaRoll": 900.0,
    **{f"Body.CogTo{side}": value for side, value in
       {"Front": 1.3, "Rear": 1.3, "Left": 0.8, "Right": 0.8}.items()},
    **each("Susp.WheelRate@", RATE),
    **NO_KINEMATICS,
    **linear_dampers(DAMPER, DAMPER),
}  # fmt: skip


def quarter_car() -> Mapping[str, Complex]:
    """Body acceleration and travel rate over the road's elevation (Mitschke)."""
    s = control.tf("s")
    body, wheel = (MASS - UNSPRUNG) / 4.0, UNSPRUNG / 4.0
    spring, tyre = RATE + DAMPER * s, parameter("Tire.Stiffness") + parameter("Tire.Damping") * s
    sprung = control.minreal(
        tyre * spring
        / ((body * s**2 + spring) * (wheel * s**2 + spring + tyre) - spring**2), verbose=False
    )  # fmt: skip
    unsprung = control.minreal(sprung * (body * s**2 + spring) / spring, verbose=False)
    omega = 2.0 * np.pi * FREQUENCIES
    z, w = (control.frequency_response(g, omega).complex for g in (sprung, unsprung))
    return {"Car.az": (1j * omega) ** 2 * z, "travel rate": 1j * omega * (w - z)}


def test_symmetric_fmu_is_the_textbooks_quarter_car() -> None:
    """In heave, with equal axles and wheels that go straight up; they also pitch, evenly."""
    found, wanted = from_road(fmu_model(False, **QUARTER), np.ones(4)), quarter_car()
    travel = np.mean([found[n] for n in TRAVEL_RATES], axis=0)
    pairs = ((found["Car.az"], wanted["Car.az"]), (travel, wanted["travel rate"]))
    errors = [float((np.abs(f / w - 1.0)).max()) for f, w in pairs]
    check = "symmetric FMU in heave: az, mean travel rate, complex gain 0.1 to 25 Hz, error [-]"
    gate(RESPONSE, check, "textbook quarter car, python-control", errors, at_most(1e-3))


# ---------------------------------------------------------------- picture

PER_MM = np.degrees(1e-3)  # rad/m -> deg/mm
PANELS = {  # road: output, label, unit, scale
    "heave": (
        ("Car.az", "vertical acceleration", "(m/s²)/m", 1.0),
        ("Car.CFL.q0p", "travel rate FL", "(m/s)/m", 1.0),
    ),
    "pitch": (
        ("Car.PitchVel", "pitch rate", "(deg/s)/mm", PER_MM),
        ("Car.CRL.q0p", "travel rate RL", "(m/s)/m", 1.0),
    ),
    "roll": (
        ("Car.RollVel", "roll rate", "(deg/s)/mm", PER_MM),
        ("Car.CFR.q0p", "travel rate FR", "(m/s)/m", 1.0),
    ),
}


@pytest.mark.validation
def test_picture(plots: Path) -> None:
    caption = (
        "Frequency responses to the road at 20 m/s: the FMU's linearisation (lines), the analytic "
        "car (dots, no grip), and the FMU with grip (dashed). Road under all wheels (heave), front "
        "against rear (pitch), left against right (roll)."
    )
    with picture(plots, RESPONSE, "frequency_responses", caption, nrows=2, ncols=3,
                 figsize=(10, 5.2), sharex=True) as (_, axes):  # fmt: skip
        for column, (name, rows) in enumerate(PANELS.items()):
            bare, grip = (from_road(fmu_model(g), PATTERNS[name]) for g in (False, True))
            wanted = analytic(CAR, PATTERNS[name])
            for ax, (output, label, unit, scale) in zip(axes[:, column], rows, strict=True):
                ax.loglog(FREQUENCIES, scale * np.abs(bare[output]), label="FMU, no grip")
                ax.loglog(FREQUENCIES, scale * np.abs(grip[output]), "--", label="FMU, grip")
                dots = slice(None, None, 4)
                ax.loglog(FREQUENCIES[dots], scale * np.abs(wanted[output])[dots], "k.", ms=4,
                          label="analytic, no grip")  # fmt: skip
                ax.set_ylabel(f"{label}, {unit}")
            axes[0, column].set_title(f"road in {name}")
            axes[1, column].set_xlabel("frequency, Hz")
        axes[0, 0].legend()
