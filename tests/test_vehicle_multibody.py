"""The multibody equations against MuJoCo on the same tree, built independently."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from gates import at_most, gate
from mujoco_tree import Oracle, sprung_body
from plant_probe import MOTION, RESPONSE, Array, Probe

TOLERANCE = 1e-9
SECTION = "Multibody equations"
MEASURED = ("acceleration", "angular_acceleration", "travel_acceleration", "kinetic_energy")
SETTINGS = {  # what the table leaves at zero, or symmetric, and so would test nothing
    "Kin.ToeFL": 0.01, "Kin.ToeRR": -0.006, "Kin.StaticCamberFR": 0.02,
    "Kin.StaticCamberRL": -0.015, "Kin.CasterFR": 0.11, "Kin.CasterRL": -0.04,
    "Wheel.RadiusScaleFL": 1.01, "Kin.KnucklePitchRR": 0.6, "Kin.RecessionCurveFL": 1.1,
}  # fmt: skip
PAYLOAD = {  # five persons and luggage: heavier, higher, further back, other inertias
    "Body.Mass": 2950.0, "Body.CogHeight": 0.71, "Body.CogToFront": 1.58, "Body.CogToRear": 1.095,
    "Body.CogToLeft": 0.80, "Body.CogToRight": 0.825, "Body.InertiaRoll": 790.0,
    "Body.InertiaPitch": 3500.0, "Body.InertiaYaw": 3890.0, "Body.UnsprungMass": 252.4,
}  # fmt: skip
LOAD = {  # on the table's car: at the back, to one side, high up
    "Load.Mass": 400.0, "Load.X": -0.5, "Load.Y": 0.2, "Load.Z": 0.35,
    "Load.InertiaRoll": 40.0, "Load.InertiaPitch": 110.0, "Load.InertiaYaw": 130.0,
}  # fmt: skip
VARIANTS = {"the table's car": {}, "uneven car": SETTINGS, "payload": PAYLOAD, "load": LOAD}


@pytest.fixture(params=VARIANTS, scope="module")
def variant(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def pair(variant: str) -> tuple[Probe, Oracle]:
    probe = Probe(VARIANTS[variant])
    return probe, Oracle(probe.parameters)


def random_motion(random: np.random.Generator) -> npt.NDArray[np.void]:
    """Far beyond driving: any attitude, travels to 60 mm, everything moves, every force acts."""
    m = np.zeros((), MOTION)
    quaternion = random.normal(size=4)
    m["quaternion"] = quaternion / np.linalg.norm(quaternion)
    scales = {
        "velocity": 30.0, "rate": 2.0, "travel_rate": 1.5, "spin": 100.0, "compliance": 0.01,
        "rack": 0.4, "force": 8000.0, "moment": 800.0, "body_force": 5000.0,
        "body_moment": 3000.0, "spring_force": 9000.0, "damper_force": 3000.0,
        "travel": 0.06, "steer_rate": 0.0,
    }  # fmt: skip
    for name, size in scales.items():
        m[name] = random.uniform(-size, size, m[name].shape)
    return m


def as_the_plant_takes_it(m: npt.NDArray[np.void], axle: Array, brake: Array) -> Any:
    """Wrenches on the wheels -> on the carriers: less what turns the wheel, plus the brake."""
    carried = m.copy()
    axial = np.einsum("ij,ij->i", m["moment"], axle)
    carried["moment"] += (brake - axial)[:, None] * axle
    return carried


def error(actual: Array, wanted: Array) -> float:
    """Largest difference over the largest component."""
    return float(np.max(np.abs(actual - wanted)) / np.max(np.abs(wanted)))


@pytest.mark.parametrize("steering", [0.0, 1.5], ids=["steer held", "steer rate"])
def test_accelerations_and_kinetic_energy_are_those_of_mujoco(
    pair: tuple[Probe, Oracle], variant: str, steering: float
) -> None:
    """The steer acceleration, whose inertia reaction the plant leaves out, is zero."""
    probe, oracle = pair
    random = np.random.default_rng(7)
    worst = dict.fromkeys(RESPONSE.fields or {}, 0.0)
    for _ in range(50):
        m = random_motion(random)
        m["steer_rate"] = random.uniform(-steering, steering, 4)
        brake = random.uniform(-2000.0, 2000.0, 4)
        answer = oracle.solve(m, brake)
        response = probe.multibody(as_the_plant_takes_it(m, answer.axle, brake))
        for name in worst:
            worst[name] = max(worst[name], error(response[name], getattr(answer, name)))
    held = "with steer rates" if steering else "steering held"
    what = "accelerations of body, in angle, of the wheel travels; kinetic energy"
    check = f"50 random states and wrenches, {held}, {variant}: {what}, error [-]"
    gate(SECTION, check, "MuJoCo, same tree", [worst[n] for n in MEASURED], at_most(TOLERANCE))
    assert max(worst.values()) < TOLERANCE, worst


def test_a_wheels_spin_answers_to_its_own_torques_alone(pair: tuple[Probe, Oracle]) -> None:
    """Why the plant may keep the spins out of its mass matrix."""
    probe, oracle = pair
    random = np.random.default_rng(8)
    for _ in range(10):
        m, brake = random_motion(random), random.uniform(-2000.0, 2000.0, 4)
        answer = oracle.solve(m, brake)
        axial = np.einsum("ij,ij->i", m["moment"], answer.axle)
        expected = (axial - brake) / probe.parameters["Wheel.Inertia"]
        assert error(answer.spin_acceleration, expected) < TOLERANCE


def test_the_tree_as_a_whole_has_the_tables_mass_centre_and_inertia() -> None:
    """At zero travel: with body and corners locked, Table 1's figures come back."""
    p = Probe().parameters
    oracle, m = Oracle(p), np.zeros((), MOTION)
    m["quaternion"] = [1.0, 0.0, 0.0, 0.0]
    oracle.solve(m, np.zeros(4))
    M, cog = oracle.locked_inertia()
    assert M[0, 0] == pytest.approx(p["Body.Mass"])
    assert cog == pytest.approx(-sprung_body(p).cog)
    printed = [p[f"Body.Inertia{axis}"] for axis in ("Roll", "Pitch", "Yaw")]
    assert np.diag(M)[3:] == pytest.approx(printed)
