"""The stationary filter and smoother against other solutions of small problems."""

from __future__ import annotations

import control
import numpy as np
import numpy.typing as npt
import pytest
from vehicle_rig import CORNERS, description

from cosim.kalman.riccati import Sampled, sampled, smoothed_covariance, stationary
from cosim.kalman.system import SUBSTEPS, System
from sensor.kalman.damper import DamperMap

Array = npt.NDArray[np.float64]
RANDOM = np.random.default_rng(11)


def small() -> Sampled:
    """A slow oscillation and a drift, of which their sum is measured."""
    turn = 0.98 * np.array([[np.cos(0.3), np.sin(0.3), 0.0], [-np.sin(0.3), np.cos(0.3), 0.0]])
    A = np.vstack([turn, [0.0, 0.0, 0.97]])
    Q = np.diag([0.02, 0.05, 1e-4])
    return Sampled(A, Q, np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 0.0]]), np.diag([0.1, 2.0]), 3)


def test_gain_and_covariances_are_python_control_s() -> None:
    p = small()
    f = stationary(p)
    L, X, _ = control.dlqe(p.A, np.eye(3), p.H, p.Q, p.R)  # L: predicts and corrects at once
    np.testing.assert_allclose(f.X, X, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(p.A @ f.K, L, rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose(f.S, p.H @ X @ p.H.T + p.R, rtol=1e-8)


def test_smoothed_covariance_is_that_of_all_samples_together() -> None:
    """Conditioning the whole run's joint normal distribution on its measurements at once."""
    p, count = small(), 160
    f = stationary(p)
    covariance = [f.X]  # of the first state; then the run is stationary for the filter
    for _ in range(count - 1):
        covariance.append(p.A @ covariance[-1] @ p.A.T + p.Q)
    joint = np.zeros((3 * count, 3 * count))
    for i in range(count):
        block = covariance[i]
        for k in range(i, count):
            joint[3 * k : 3 * k + 3, 3 * i : 3 * i + 3] = block
            joint[3 * i : 3 * i + 3, 3 * k : 3 * k + 3] = block.T
            block = p.A @ block
    H, R = np.kron(np.eye(count), p.H), np.kron(np.eye(count), p.R)
    gain = np.linalg.solve(H @ joint @ H.T + R, H @ joint).T
    after = joint - gain @ H @ joint
    middle = slice(3 * 80, 3 * 80 + 3)
    np.testing.assert_allclose(after[middle, middle], smoothed_covariance(p, f), rtol=1e-3)


def test_the_error_is_as_large_as_predicted() -> None:
    p = small()
    f = stationary(p)
    count = 30_000
    noise = RANDOM.standard_normal((count, 3)) @ np.sqrt(p.Q)
    seen = RANDOM.standard_normal((count, 2)) @ np.sqrt(p.R)
    x, estimate = np.zeros(3), np.zeros(3)
    errors = np.empty((count, 3))
    for k in range(count):
        x = p.A @ x + noise[k]
        estimate = p.A @ estimate
        estimate = estimate + f.K @ (p.H @ x + seen[k] - p.H @ estimate)
        errors[k] = estimate - x
    ratio = errors[2000:].std(axis=0) / np.sqrt(np.diag(f.P))
    assert ratio == pytest.approx(1.0, abs=0.04)


def test_an_unseen_drift_has_no_stationary_filter() -> None:
    p = small()
    A = p.A.copy()
    A[2, 2] = 1.1
    blind = Sampled(A, p.Q, p.H * [1.0, 1.0, 0.0], p.R, 3)
    with pytest.raises(ArithmeticError, match="does not settle"):
        stationary(blind)


def follower(tap: float) -> System:
    """Front (sum, difference) roads in states 0, 1 and rear ones in states 2, 3, of one substep."""
    names = tuple(f"travel_rate.{c}" for c in CORNERS)
    return System(
        names, np.zeros((4, 4)), np.eye(4), np.zeros(4), np.zeros((4, 4)), 1e-12 * np.eye(4),
        np.eye(4)[:2], np.zeros(2), tap * np.eye(2), ((), ()),
    )  # fmt: skip


def test_the_rear_wheels_meet_the_front_wheels_road() -> None:
    """Fronts seen perfectly, once a sample: rear roads are known where the tap was seen, up to
    the share that the front wheels have not met.
    """
    s = follower(1e-9)
    seen_delay = 2.0 * SUBSTEPS
    p = sampled(s, [0, 1], seen_delay, rear=0.09)
    f = stationary(p)
    assert np.diag(f.P)[2:4] == pytest.approx(0.09, rel=1e-3)
    unseen = stationary(sampled(s, [0, 1], seen_delay + 1.0, rear=0.09))
    assert np.diag(unseen.P)[2:4] == pytest.approx(1.09, rel=1e-3)
    without = stationary(sampled(s, [0, 1], None, rear=0.09))
    assert np.diag(without.P)[2:4] == pytest.approx(1.0, rel=1e-3)


def test_the_filter_s_dampers_are_the_vehicle_s() -> None:
    variables = description().variables
    d = DamperMap()
    for kind, tables in (("Soft", d.soft), ("Passive", d.passive), ("Hard", d.hard)):
        for way, table in zip(("Rebound", "Compression"), tables, strict=True):
            starts = [variables[f"Damp.{kind}{way}{k}"].start for k in range(1, len(table) + 1)]
            assert [float(str(start)) for start in starts] == list(table)
    scales = [float(str(variables[f"Damp.Scale{c}"].start)) for c in CORNERS]
    assert scales == list(d.scale)
    assert float(str(variables["Damp.ValveLag"].start)) == d.lag
