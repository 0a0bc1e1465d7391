"""The multibody equations against MuJoCo on the same tree, built independently."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from mujoco_tree import CORNERS, Answer, Oracle, hubs, sprung_body
from plant_probe import MOTION, Array, Probe, compile_probe, table_values

TOLERANCE = 1e-9
SETTINGS = {  # what the table leaves at zero, or symmetric, and so would test nothing
    **{"Kin.ToeFL": 0.01, "Kin.ToeRR": -0.006, "Kin.StaticCamberFR": 0.02},
    **{"Kin.StaticCamberRL": -0.015, "Kin.CasterFR": 0.11, "Kin.CasterRL": -0.04},
    **{"Wheel.RadiusScaleFL": 1.01, "Kin.KnucklePitchRR": 0.6, "Kin.RecessionCurveFL": 1.1},
}


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compile_probe(tmp_path_factory.mktemp("probe"))


@pytest.fixture(params=[{}, SETTINGS], ids=["table", "uneven"], scope="module")
def pair(request: pytest.FixtureRequest, library: Path) -> tuple[Probe, Oracle]:
    probe = Probe(library, request.param)
    return probe, Oracle(probe.parameters)


def random_motion(random: np.random.Generator) -> npt.NDArray[np.void]:
    """Far beyond driving: any attitude, travels to 60 mm, everything moves, every force acts."""
    m = np.zeros((), MOTION)
    quaternion = random.normal(size=4)
    m["quaternion"] = quaternion / np.linalg.norm(quaternion)
    scales = {
        **{"velocity": 30.0, "rate": 2.0, "travel_rate": 1.5, "spin": 100.0, "compliance": 0.01},
        **{"rack": 0.4, "force": 8000.0, "moment": 800.0, "body_force": 5000.0},
        **{"body_moment": 3000.0, "spring_force": 9000.0, "damper_force": 3000.0},
        **{"travel": 0.06, "steer_rate": 0.0},
    }
    for name, size in scales.items():
        m[name] = random.uniform(-size, size, m[name].shape)
    return m


def as_the_plant_takes_it(m: npt.NDArray[np.void], axle: Array, brake: Array) -> Any:
    """Wrenches on the wheels -> on the carriers: what turns the wheel left out, the brake put in."""
    carried = m.copy()
    axial = np.einsum("ij,ij->i", m["moment"], axle)
    carried["moment"] += (brake - axial)[:, None] * axle
    return carried


def error(actual: Array, wanted: Array) -> float:
    """Largest difference over the largest component."""
    return float(np.max(np.abs(actual - wanted)) / np.max(np.abs(wanted)))


def compare(probe: Probe, answer: Answer, response: Any) -> dict[str, float]:
    """Relative error of each figure that both sides work out."""
    return {
        name: error(response[name], getattr(answer, name))
        for name in response.dtype.names
        if name != "axial"
    }


@pytest.mark.parametrize("steering", [0.0, 1.5], ids=["steer held", "steer rate"])
def test_accelerations_and_kinetic_energy_are_those_of_mujoco(
    pair: tuple[Probe, Oracle], steering: float
) -> None:
    probe, oracle = pair
    random = np.random.default_rng(7)
    worst: dict[str, float] = {}
    for _ in range(50):
        m = random_motion(random)
        m["steer_rate"] = random.uniform(-steering, steering, 4)
        brake = random.uniform(-2000.0, 2000.0, 4)
        answer = oracle.solve(m, brake)
        response = probe.multibody(as_the_plant_takes_it(m, answer.axle, brake))
        for name, value in compare(probe, answer, response).items():
            worst[name] = max(worst.get(name, 0.0), value)
    assert max(worst.values()) < TOLERANCE, worst
    print(worst)


def test_a_wheels_spin_answers_to_its_own_torques_alone(pair: tuple[Probe, Oracle]) -> None:
    probe, oracle = pair
    random = np.random.default_rng(8)
    for _ in range(10):
        m, brake = random_motion(random), random.uniform(-2000.0, 2000.0, 4)
        answer = oracle.solve(m, brake)
        axial = np.einsum("ij,ij->i", m["moment"], answer.axle)
        expected = (axial - brake) / probe.parameters["Wheel.Inertia"]
        assert answer.spin_acceleration == pytest.approx(expected, rel=TOLERANCE)
