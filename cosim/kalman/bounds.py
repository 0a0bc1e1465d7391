"""What a linear estimator can reach on a car that is linear: the Riccati equation's own answer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_discrete_lyapunov

from cosim.fmi import Description
from cosim.kalman.design import VARIANTS, Design, Variant, design
from cosim.kalman.noise import least
from cosim.kalman.plant import Plant, damped, plant
from cosim.road.iso8608 import ROUGHNESS
from cosim.vehicle import builtin_fmu
from sensor.conditions import CONDITIONS, Condition
from sensor.kalman.damper import equivalent_damping

Array = npt.NDArray[np.float64]

ROUNDS: Final = 4  # of damping and suspension velocity, which depend on each other
COHERENCE: Final = {"A": 4.5, "B": 3.6, "C": 2.6}  # left and right alike below it, `Iso8608`


@dataclass(frozen=True)
class Case:
    """A road class at a speed [km/h]."""

    road_class: str
    speed_kmh: int

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"{self.road_class} at {self.speed_kmh} km/h"


CASES: Final = (Case("A", 50), Case("B", 50), Case("C", 50), Case("B", 80), Case("A", 100))


def bounds(case: Case) -> dict[str, Any]:
    """Return `truth` [m/s], rms of the suspension velocity, and the `accuracy` [%] by condition and
    estimator: the four filters and "smoother", the fixed-interval smoother of the full one.
    """
    at, truth = _linear_car(case)
    return {
        "case": case.name,
        "truth": truth,
        "accuracy": {
            condition: _accuracies(case, at, truth, condition) for condition in CONDITIONS
        },
    }


def _accuracies(case: Case, at: Plant, truth: float, condition: Condition) -> dict[str, float]:
    found = {}
    for name, variant in VARIANTS.items():
        d = _design(case, at, variant, condition)
        found[name] = _accuracy(d.deviation(), truth)
        if name == "kalman":
            found["smoother"] = _accuracy(d.smoothed_deviation(), truth)
    return found


def _accuracy(deviation: Array, truth: float) -> float:
    return 100.0 * (1.0 - float(np.sqrt(np.square(deviation).mean())) / truth)


def _design(case: Case, at: Plant, variant: Variant, condition: Condition) -> Design:
    assumed = replace(
        least(condition),
        roughness=ROUGHNESS[case.road_class],
        coherence=COHERENCE[case.road_class],
    )
    return design(at, variant, condition, assumed)


def _linear_car(case: Case) -> tuple[Plant, float]:
    """Return the car with the dampers that its own suspension velocity makes, and that velocity."""
    deviation = 0.05
    at = plant(Description(builtin_fmu()), case.speed_kmh / 3.6, equivalent_damping(deviation))
    for _ in range(ROUNDS):
        at = damped(at, equivalent_damping(deviation))
        deviation = _suspension_velocity(_design(case, at, VARIANTS["kalman_imu"], "ideal"))
    return at, deviation


def _suspension_velocity(d: Design) -> float:
    """Return the rms of the four suspension velocities [m/s] before anything is measured."""
    covariance = solve_discrete_lyapunov(d.sampled.A, d.sampled.Q)
    return float(np.sqrt(np.diag(covariance)[d.system.rates].mean()))
