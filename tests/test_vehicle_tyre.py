"""The tyre against PAC2002 as published, written once more here, and against its own limits.

Equations: Pacejka, Tire and Vehicle Dynamics, 3rd ed., section 4.3.2 (4.E1 to 4.E71), in the
PAC2002 form; every coefficient that is not below is zero. ISO signs: positive slip angle, negative
lateral force. The side-dependent terms are the left wheel's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gates import at_most, between, gate
from hypothesis import given, settings
from hypothesis import strategies as st
from plant_probe import Array, Probe
from vehiclemodels.utils import tire_model

FZ0, R0, STIFFNESS = 6000.0, 0.3705, 225368.0
COEFFICIENTS = {
    "PCX1": 1.839, "PDX1": 1.139, "PDX2": -0.120, "PEX1": 0.627, "PEX2": -0.123,
    "PEX3": -0.034, "PKX1": 18.886, "PKX2": -3.988, "PKX3": 0.2154,
    "RBX1": 5.99, "RBX2": -8.26, "RCX1": 1.078, "REX1": 1.644, "RHX1": 0.0088,
    "PCY1": 1.322, "PDY1": 1.014, "PDY2": -0.1227, "PDY3": -1.04, "PEY1": -0.638,
    "PEY2": -0.051, "PEY3": -0.273, "PEY4": -8.31, "PKY1": -19.80, "PKY2": 1.80,
    "PKY3": 0.0095, "RBY1": 6.22, "RBY2": 3.07, "RBY3": 0.016, "RCY1": 1.005, "REY1": 0.0197,
    "PTY1": 1.9, "PTY2": 2.25, "QBZ1": 7.51, "QCZ1": 1.224, "QDZ1": 0.0626, "QEZ1": -5.4,
    "QSY1": 0.01, "BREFF": 8.4, "DREFF": 0.27, "FREFF": 0.07,
}  # fmt: skip
TOLERANCE = 1e-12
LOADS = (800.0, 3000.0, 6000.0, 9000.0, 14000.0)
SIDES = {0: 1.0, 1: -1.0}  # of the front corners


def magic(B: float, C: float, E: float, s: float) -> float:
    """The argument of the sine or cosine, with the book's bound E <= 1."""
    return C * math.atan(B * s - min(E, 1.0) * (B * s - math.atan(B * s)))


@dataclass(frozen=True)
class Pac2002:
    """Coefficients and the scales of friction (LMUX, LMUY)."""

    c: dict[str, float]
    scale_x: float = 1.0
    scale_y: float = 1.0

    def stiffness_x(self, Fz: float) -> float:
        c, d = self.c, (Fz - FZ0) / FZ0
        return Fz * (c["PKX1"] + c["PKX2"] * d) * math.exp(c["PKX3"] * d)

    def stiffness_y(self, Fz: float, gamma: float) -> float:
        c = self.c
        at_no_camber = c["PKY1"] * FZ0 * math.sin(2 * math.atan(Fz / (c["PKY2"] * FZ0)))
        return at_no_camber * (1 - c["PKY3"] * abs(gamma))

    def peaks(self, Fz: float, gamma: float) -> tuple[float, float]:
        c, d = self.c, (Fz - FZ0) / FZ0
        mu_x = (c["PDX1"] + c["PDX2"] * d) * self.scale_x
        mu_y = (c["PDY1"] + c["PDY2"] * d) * (1 - c["PDY3"] * gamma**2) * self.scale_y
        return mu_x * Fz, mu_y * Fz

    def longitudinal(self, Fz: float, kappa: float, alpha: float) -> float:
        c, d = self.c, (Fz - FZ0) / FZ0
        D, _ = self.peaks(Fz, 0.0)
        E = c["PEX1"] + c["PEX2"] * d + c["PEX3"] * d**2
        pure = D * math.sin(magic(self.stiffness_x(Fz) / (c["PCX1"] * D), c["PCX1"], E, kappa))
        B = c["RBX1"] * math.cos(math.atan(c["RBX2"] * kappa))
        weight = math.cos(magic(B, c["RCX1"], c["REX1"], alpha + c["RHX1"]))
        return pure * weight / math.cos(magic(B, c["RCX1"], c["REX1"], c["RHX1"]))

    def lateral(self, Fz: float, kappa: float, alpha: float, gamma: float) -> float:
        c, d = self.c, (Fz - FZ0) / FZ0
        _, D = self.peaks(Fz, gamma)
        sign = math.copysign(1.0, alpha)
        E = (c["PEY1"] + c["PEY2"] * d) * (1 - (c["PEY3"] + c["PEY4"] * gamma) * sign)
        B = self.stiffness_y(Fz, gamma) / (c["PCY1"] * D)
        pure = D * math.sin(magic(B, c["PCY1"], E, alpha))
        weight = c["RBY1"] * math.cos(math.atan(c["RBY2"] * (alpha - c["RBY3"])))
        return pure * math.cos(magic(weight, c["RCY1"], c["REY1"], kappa))

    def aligning(self, Fz: float, kappa: float, alpha: float, gamma: float) -> float:
        c, stiffness = self.c, self.stiffness_x(Fz) / self.stiffness_y(Fz, gamma)
        equivalent = math.atan(math.hypot(math.tan(alpha), stiffness * kappa))
        equivalent = math.copysign(equivalent, alpha)
        B = c["QBZ1"] / self.scale_y  # 4.E40
        trail = Fz * c["QDZ1"] * R0 / FZ0 * math.cos(magic(B, c["QCZ1"], c["QEZ1"], equivalent))
        return -trail * math.cos(alpha) * self.lateral(Fz, kappa, alpha, gamma)


@pytest.fixture(scope="module")
def plant() -> Probe:
    return Probe()


def test_the_coefficients_are_the_published_set(plant: Probe) -> None:
    table = {name: plant.parameters[f"Tire.{name}"] for name in COEFFICIENTS}
    assert table == COEFFICIENTS
    constants = [plant.parameters[f"Tire.{n}"] for n in ("NominalLoad", "Radius", "Stiffness")]
    assert constants == [FZ0, R0, STIFFNESS]


SLIPS = [(0.05, 0.0), (-0.3, 0.0), (0.0, 0.04), (0.0, -0.2), (0.1, 0.1), (-0.6, -0.3), (1.2, 1.4)]


@pytest.mark.parametrize("friction", [(1.0, 1.0, 1.0), (0.9, 0.97, 1.0), (1.0, 0.97, 0.4)])
def test_forces_are_those_of_the_published_equations(friction: tuple[float, float, float]) -> None:
    names = ("Tire.FrictionX", "Tire.FrictionY", "Road.Friction")
    plant = Probe(dict(zip(names, friction, strict=True)))
    book = Pac2002(COEFFICIENTS, friction[0] * friction[2], friction[1] * friction[2])
    for Fz in LOADS:
        for gamma in (-0.12, 0.0, 0.05):
            for kappa, alpha in SLIPS:
                got = plant.magic_formula(Fz, kappa, math.tan(alpha), gamma, 1.0)
                peak_x, peak_y = book.peaks(Fz, gamma)
                wanted = {
                    "Fx": (book.longitudinal(Fz, kappa, alpha), peak_x),
                    "Fy": (book.lateral(Fz, kappa, alpha, gamma), peak_y),
                    "Mz": (book.aligning(Fz, kappa, alpha, gamma), 0.05 * peak_y),
                    "peak_x": (peak_x, peak_x),
                    "peak_y": (peak_y, peak_y),
                }
                for name, (value, size) in wanted.items():
                    where = (name, Fz, gamma, kappa, alpha)
                    assert abs(got[name] - value) <= TOLERANCE * size, where


# ---------------------------------------------------------------- tyres that others wrote

TYRES = "Tyres"


def errors_against(expected: Array, plant: Probe) -> list[float]:
    """Fx, Fy, Mz: largest difference over the largest value; columns Fz kappa alpha gamma, F."""
    found = []
    for Fz, kappa, alpha, gamma in expected[:, :4]:
        forces = plant.magic_formula(Fz, kappa, math.tan(alpha), gamma, 1.0)
        found.append([forces[name] for name in ("Fx", "Fy", "Mz")])
    wanted = expected[:, 4:]
    off = np.abs(np.array(found)[:, : wanted.shape[1]] - wanted)
    return list(off.max(axis=0) / np.abs(wanted).max(axis=0))


def test_forces_are_those_of_opentire(plant: Probe) -> None:
    """180 points over load, camber and slips, by a program of other authors."""
    path = Path(__file__).with_name("pac2002_opentire.csv")
    expected = np.loadtxt(path, delimiter=",", comments=("#", "Fz"))
    assert expected.shape == (180, 7)
    check = "180 points of load, slips, camber: Fx, Fy, Mz, error over the largest [-]"
    oracle = "OpenTire's PAC2002, values in tests/pac2002_opentire.csv"
    gate(TYRES, check, oracle, errors_against(expected, plant), at_most(1e-9))


def commonroad(kappa: float, alpha: float) -> tuple[float, float]:
    """Fx and Fy by CommonRoad's tyre at the nominal load, without camber; its kappa brakes."""
    c, side = COEFFICIENTS, math.copysign(1.0, alpha)
    values = {
        **{f"p_{n.lower()[1:]}": c[n] for n in ("PCX1", "PDX1", "PEX1", "PKX1", "PCY1")},
        **{f"r_{n.lower()[1:]}": c[n] for n in ("RBX1", "RBX2", "RCX1", "RHX1")},
        **{f"r_{n.lower()[1:]}": c[n] for n in ("RBY1", "RBY2", "RBY3", "RCY1", "REY1")},
        "r_ex1": min(c["REX1"], 1.0),  # that program leaves the bound E <= 1 to its user
        "p_dy1": 0.97 * c["PDY1"],
        "p_ey1": c["PEY1"] * (1.0 - c["PEY3"] * side),
        "p_ky1": c["PKY1"] * math.sin(2.0 * math.atan(1.0 / c["PKY2"])),
        **dict.fromkeys(("p_dx3", "p_hx1", "p_vx1", "p_dy3", "p_hy1", "p_hy3", "p_vy1"), 0.0),
        **dict.fromkeys(("p_vy3", "r_hy1", *(f"r_vy{k}" for k in (1, 3, 4, 5, 6))), 0.0),
    }
    p = SimpleNamespace(**values)
    Fx0 = tire_model.formula_longitudinal(-kappa, 0.0, FZ0, p)
    Fy0, mu = tire_model.formula_lateral(alpha, 0.0, FZ0, p)
    Fx = tire_model.formula_longitudinal_comb(-kappa, alpha, Fx0, p)
    return Fx, tire_model.formula_lateral_comb(-kappa, alpha, 0.0, mu, FZ0, Fy0, p)


def test_forces_are_those_of_commonroads_tyre(plant: Probe) -> None:
    """The Magic Formula of the package commonroad-vehicle-models, which knows one load."""
    slips = np.linspace(-0.6, 0.6, 25)
    expected = np.array(
        [(FZ0, k, a, 0.0, *commonroad(float(k), float(a))) for k in slips for a in slips]
    )
    check = "625 slips at the nominal load: Fx, Fy, error over the largest [-]"
    oracle = "package commonroad-vehicle-models"
    gate(TYRES, check, oracle, errors_against(expected, plant), at_most(1e-12))


def test_known_points_of_the_tyre() -> None:
    unscaled, small = Probe({"Tire.FrictionX": 1.0, "Tire.FrictionY": 1.0}), 1e-7
    at_rest = unscaled.magic_formula(FZ0, small, 0.0, 0.0, 1.0)
    aside = unscaled.magic_formula(FZ0, 0.0, small, 0.0, 1.0)
    check = "cornering stiffness at 6 kN [kN/rad]"
    stiffness = -aside["Fy"] / small / 1e3
    gate(TYRES, check, "PKY1 Fz0 sin(2 atan(1 / PKY2))", stiffness, between(100.86, 100.88))
    assert at_rest["Fx"] / small == pytest.approx(113.3e3, rel=1e-3)
    assert (at_rest["peak_x"], aside["peak_y"]) == pytest.approx((1.139 * FZ0, 1.014 * FZ0))
    largest = max(-unscaled.magic_formula(FZ0, 0, t, 0, 1.0)["Fy"] for t in np.arange(0, 1, 1e-3))
    assert largest == pytest.approx(1.014 * FZ0, rel=1e-5)
    assert unscaled.relaxation_y(FZ0, R0) == pytest.approx(0.5226, abs=1e-4)
    assert unscaled.rolling_radius(FZ0, R0) == pytest.approx(0.3582, abs=1e-4)


def test_rolling_radius_and_relaxation_follow_their_formulas(plant: Probe) -> None:
    for Fz in LOADS:
        load = Fz / FZ0
        drop = FZ0 / STIFFNESS * (0.07 * load + 0.27 * math.atan(8.4 * load))
        assert plant.rolling_radius(Fz, R0) == pytest.approx(R0 - drop, rel=TOLERANCE)
        length = 1.9 * math.sin(2 * math.atan(load / 2.25)) * R0
        assert plant.relaxation_y(Fz, R0) == pytest.approx(length, rel=TOLERANCE)


def test_the_rolling_radius_keeps_its_nominal_value_without_the_load_term(plant: Probe) -> None:
    nominal = plant.rolling_radius(FZ0, R0)
    fixed = Probe({"Tire.LoadDependentRadius": 0.0})
    assert [fixed.rolling_radius(Fz, R0) for Fz in LOADS] == [nominal] * len(LOADS)


def test_more_load_more_force_and_less_radius(plant: Probe) -> None:
    loads, small = np.linspace(600.0, 10800.0, 60), 1e-6
    curves = {
        "peak_x": [plant.magic_formula(Fz, 0, 0, 0, 1)["peak_x"] for Fz in loads],
        "peak_y": [plant.magic_formula(Fz, 0, 0, 0, 1)["peak_y"] for Fz in loads],
        "braking stiffness": [plant.magic_formula(Fz, small, 0, 0, 1)["Fx"] for Fz in loads],
        "cornering stiffness": [-plant.magic_formula(Fz, 0, small, 0, 1)["Fy"] for Fz in loads],
        "relaxation": [plant.relaxation_y(Fz, R0) for Fz in loads],
        "radius": [-plant.rolling_radius(Fz, R0) for Fz in loads],
    }
    for name, curve in curves.items():
        assert np.all(np.diff(curve) > 0), name


def test_friction_per_load_falls_with_load(plant: Probe) -> None:
    ratio = [plant.magic_formula(Fz, 0, 0, 0, 1)["peak_y"] / Fz for Fz in LOADS]
    assert np.all(np.diff(ratio) < 0)


slip_x = st.floats(-1.5, 1.5)
slip_y = st.floats(-1.7, 1.7)
load = st.floats(50.0, 20000.0)
camber = st.floats(-0.2, 0.2)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(Fz=load, kappa=slip_x, tan_alpha=slip_y, gamma=camber)
def test_right_wheels_mirror_left_wheels(
    plant: Probe, Fz: float, kappa: float, tan_alpha: float, gamma: float
) -> None:
    left = plant.magic_formula(Fz, kappa, tan_alpha, gamma, 1.0)
    right = plant.magic_formula(Fz, kappa, -tan_alpha, -gamma, -1.0)
    assert right == {**left, "Fy": -left["Fy"], "Mz": -left["Mz"]}


Rolling = dict[str, Any]


def usage(grip: dict[str, float]) -> float:
    """Share of the friction ellipse."""
    return math.hypot(grip["Fx"] / grip["peak_x"], grip["Fy"] / grip["peak_y"])


speed = st.floats(-60.0, 60.0)
rolling = st.fixed_dictionaries(
    {
        "deflection": st.floats(-0.05, 0.08),
        "deflection_rate": st.floats(-5.0, 5.0),
        "sine_inclination": camber,
        "spin": st.floats(-170.0, 170.0),
        "stretch_x": st.floats(-0.6, 0.6),
        "stretch_y": st.floats(-1.2, 1.2),
        "velocity": st.tuples(speed, speed, st.floats(-3.0, 3.0)),
    }
)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(state=rolling, friction=st.floats(0.05, 1.5))
def test_forces_stay_inside_friction_and_never_pull(state: Rolling, friction: float) -> None:
    """Carcass damping may not lift the pair of forces over friction where the formula does not."""
    plant = Probe({"Road.Friction": friction})
    grip = plant.tyre(0, **state)
    assert grip["Fz"] >= 0.0
    if grip["Fz"] == 0.0:
        assert (grip["Fx"], grip["Fy"]) == (0.0, 0.0)
        return
    slips = (grip["slip_x"], grip["slip_y"], float(state["sine_inclination"]))
    formula = usage(plant.magic_formula(grip["Fz"], *slips, 1.0))
    assert abs(grip["Fx"]) <= grip["peak_x"]
    assert abs(grip["Fy"]) <= grip["peak_y"]
    assert usage(grip) <= max(1.0, formula) + 1e-9


@settings(max_examples=300, deadline=None, derandomize=True)
@given(Fz=load, kappa=slip_x, tan_alpha=slip_y, gamma=camber)
def test_combined_slip_leaves_little_of_either_force(
    plant: Probe, Fz: float, kappa: float, tan_alpha: float, gamma: float
) -> None:
    """The published set's weighting lets the pair pass the friction ellipse by 21 % at most."""
    assert usage(plant.magic_formula(Fz, kappa, tan_alpha, gamma, 1.0)) < 1.22


@pytest.mark.parametrize(
    ("deflection", "rate"), [(0.0, 0.0), (-0.02, 3.0), (0.002, -5.0)], ids=["bare", "off", "lift"]
)
def test_off_the_ground_there_is_no_force(plant: Probe, deflection: float, rate: float) -> None:
    grip = plant.tyre(
        0,
        deflection=deflection,
        deflection_rate=rate,
        spin=50.0,
        stretch_x=0.1,
        stretch_y=-0.2,
        velocity=(10.0, 2.0, 0.0),
    )
    assert [grip[name] for name in ("Fx", "Fy", "Fz", "Mz", "My", "dissipation")] == [0.0] * 6
    assert grip["stretch_x_rate"] < 0 < grip["stretch_y_rate"]  # the carcass recovers


@pytest.mark.parametrize("corner", [0, 1])
def test_a_carcass_at_rest_in_its_flow_has_the_kinematic_slip(plant: Probe, corner: int) -> None:
    """Where the deflection no longer changes, slip is -V_s / |V_x| and the damping is silent."""
    vx, vy, deflection = 20.0, 0.8, 0.0266
    Fz = STIFFNESS * deflection
    radius = plant.rolling_radius(Fz, R0)
    state: Rolling = {
        "deflection": deflection,
        "spin": 1.03 * vx / radius,
        "velocity": (vx, vy, 0.0),
    }
    stretch = {
        "stretch_x": 0.03 * plant.parameters["Tire.RelaxationX"],
        "stretch_y": -vy / vx * plant.relaxation_y(Fz, R0),
    }
    grip = plant.tyre(corner, **state, **stretch)
    assert (grip["slip_x"], grip["slip_y"]) == pytest.approx((0.03, vy / vx))
    assert (grip["stretch_x_rate"], grip["stretch_y_rate"]) == pytest.approx((0, 0), abs=1e-12)
    steady = plant.magic_formula(Fz, 0.03, vy / vx, 0.0, SIDES[corner])
    assert (grip["Fx"], grip["Fy"]) == pytest.approx((steady["Fx"], steady["Fy"]))


def test_the_lateral_force_builds_up_over_the_relaxation_length(plant: Probe) -> None:
    deflection, vx, vy, step = 0.0266, 10.0, 0.1, 1e-4
    sigma = plant.relaxation_y(STIFFNESS * deflection, R0)
    spin = vx / plant.rolling_radius(STIFFNESS * deflection, R0)
    stretch = 0.0
    for _ in range(round(sigma / vx / step)):
        state: Rolling = {"deflection": deflection, "spin": spin, "velocity": (vx, vy, 0.0)}
        stretch += step * plant.tyre(0, **state, stretch_y=stretch)["stretch_y_rate"]
    share = -stretch / (sigma * vy / vx)
    assert share == pytest.approx(1 - math.exp(-1), abs=2e-3)


def test_rolling_resistance_brakes_either_way(plant: Probe) -> None:
    forward = plant.tyre(0, deflection=0.0266, spin=30.0, velocity=(10.7, 0.0, 0.0))
    backward = plant.tyre(0, deflection=0.0266, spin=-30.0, velocity=(-10.7, 0.0, 0.0))
    assert forward["My"] == pytest.approx(-0.01 * R0 * STIFFNESS * 0.0266)
    assert backward["My"] == -forward["My"]
