"""The Kalman filter at run time: its parts, its smoother, and the shipped filters' manners."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.linalg import solve_discrete_are

from sensor.channels import CHANNEL_NAMES, PASSIVE_COMMAND
from sensor.conditions import CONDITIONS, Condition
from sensor.errors import SensorError
from sensor.estimators import MODELS, make
from sensor.kalman import KalmanFilter, KalmanModel, Smoother
from sensor.kalman.damper import Curve, DamperMap, Dampers, equivalent_damping
from sensor.kalman.delay import DelayLine
from sensor.kalman.filter import LARGEST
from sensor.kalman.model import GAINS, MODEL, SETS

Array = npt.NDArray[np.float64]
SHIPPED = [
    (name, condition)
    for name in ("kalman_imu", "kalman_wheels", "kalman_delay", "kalman")
    for condition in CONDITIONS
    if (MODELS / f"{name}_{condition}.npz").is_file()
]
PASSIVE = np.full(4, PASSIVE_COMMAND)


def test_curve_is_the_monotone_cubic_through_the_table() -> None:
    rebound, compression = DamperMap().passive
    v = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0)
    x = [*(-a for a in reversed(v)), 0.0, *v]
    table = PchipInterpolator(x, [*(-f for f in reversed(compression)), 0.0, *rebound])
    curve = Curve(rebound, compression)
    inner = np.linspace(-0.99, 0.99, 397)  # PCHIP's end slopes differ, so not the last pieces
    force, slope = np.array([curve.force(float(a)) for a in inner]).T
    np.testing.assert_allclose(force, table(inner), atol=1e-9)
    np.testing.assert_allclose(slope, table.derivative()(inner), atol=1e-6)
    assert curve.force(3.0)[0] == pytest.approx(6500.0)  # straight beyond: 2000 N s/m


def test_valves_follow_and_curves_blend() -> None:
    dampers = Dampers()
    soft, passive, hard = (Curve(*t) for t in (DamperMap.soft, DamperMap.passive, DamperMap.hard))
    dampers.set(np.array([0.0, PASSIVE_COMMAND, 1.0, 0.65]))
    middle = 0.5 * (passive.force(0.2)[0] + hard.force(0.2)[0])
    expected = (soft.force(0.2)[0], passive.force(0.2)[0], 1.33 * hard.force(0.2)[0], 1.33 * middle)
    assert [dampers.force(i, 0.2)[0] for i in range(4)] == pytest.approx(expected)
    dampers.set(np.ones(4))
    share = 1.0 - np.exp(-10.0 / 12.0)
    hard_share = (share - PASSIVE_COMMAND) / (1.0 - PASSIVE_COMMAND)
    low, high = passive.force(0.2)[0], hard.force(0.2)[0]
    assert dampers.force(0, 0.2)[0] == pytest.approx(low + hard_share * (high - low))


def test_equivalent_damping_of_small_motion_is_the_slope_at_rest() -> None:
    slope = Curve(*DamperMap().passive).force(0.0)[1]
    assert equivalent_damping(1e-4)[:2] == pytest.approx(slope, rel=2e-3)


def test_the_road_comes_back_after_a_wheelbase_whatever_the_speed() -> None:
    """Front road sin(s) held over each substep; the rear meets it 2.5 m later."""
    line = DelayLine(200, 2.5)
    come, errors = 0.0, []
    for k in range(3000):
        way = 0.05 * (1.0 + 0.6 * np.sin(0.004 * k))
        rear = line.step(way).copy()
        line.taps[:, 0] = np.sin(come + 0.5 * way), np.cos(come + 0.5 * way)
        come += way
        if come > 3.0:
            met = come - 0.5 * way - 2.5
            errors.append(rear - [np.sin(met), np.cos(met)])
    assert np.abs(errors).max() < 0.005
    line.reset()
    assert not line.step(5.0).any()


def linear_model(A: Array, H: Array, Q: Array, R: Array) -> KalmanModel:
    """A model of four travel rates, two more states and three channels, without damper or delay."""
    n, p = len(A), len(H)
    X = solve_discrete_are(A.T, H.T, Q, R)
    S = H @ X @ H.T + R
    K = np.linalg.solve(S, H @ X).T
    P = X - K @ H @ X
    parts = {
        "still": np.zeros(p), "rest": np.zeros(n), "F": A, "rear": np.zeros((n, 2)),
        "steer": np.zeros(n), "damper": np.zeros((n, 4)), "H": H, "D": np.zeros(p),
        "damping": np.zeros(4),
    }  # fmt: skip
    gains = {
        "K": K, "K_taps": np.zeros((2, 0, p)), "P": -P[:4], "P_taps": np.zeros((4, 2, 0)),
        "information": np.linalg.inv(S), "deviation": np.sqrt(np.diag(P)[:4]),
    }  # fmt: skip
    assert set(parts) == set(MODEL)
    assert set(gains) == set(GAINS)
    parts |= {f"{prefix}{name}": part for prefix in SETS for name, part in gains.items()}
    return KalmanModel(
        speeds=np.array([0.0, 20.0, 40.0]), parts={k: np.stack([v] * 3) for k, v in parts.items()},
        rows=np.arange(3), rates=np.arange(4), offsets=np.array([4, 5, 4]), first=np.zeros(p),
        moved=np.zeros((2, 0), dtype=np.int64), limits=np.full(p, 1e9), calibration=1.0,
        wheelbase=2.5, substeps=1, taps=0, about={},
    )  # fmt: skip


def test_filter_and_smoother_are_the_textbook_s() -> None:
    """Rauch, Tung and Striebel's recursion with the same stationary gains."""
    random = np.random.default_rng(5)
    n, count = 6, 300
    A = random.normal(size=(n, n))
    A *= 0.95 / np.abs(np.linalg.eigvals(A)).max()
    H, Q, R = random.normal(size=(3, n)), 0.1 * np.eye(n), np.diag([0.5, 1.0, 0.2])
    x, truth, y = np.zeros(n), np.empty((count, n)), np.empty((count, 3))
    for k in range(count):
        x = A @ x + np.sqrt(0.1) * random.standard_normal(n)
        truth[k], y[k] = x, H @ x + np.sqrt(np.diag(R)) * random.standard_normal(3)
    X = solve_discrete_are(A.T, H.T, Q, R)
    K = np.linalg.solve(H @ X @ H.T + R, H @ X).T
    P = X - K @ H @ X
    filtered = np.zeros((count, n))
    before = np.zeros(n)
    for k in range(count):
        filtered[k] = before + K @ (y[k] - H @ before)
        before = A @ filtered[k]
    smoothed = filtered.copy()
    for k in range(count - 2, -1, -1):
        back = P @ A.T @ np.linalg.inv(X)
        smoothed[k] = filtered[k] + back @ (smoothed[k + 1] - A @ filtered[k])
    channels = np.zeros((count, 14))
    channels[:, :3], channels[:, CHANNEL_NAMES.index("Car.vx")] = y, 10.0
    model = linear_model(A, H, Q, R)
    commands = np.tile(PASSIVE, (count, 1))
    np.testing.assert_allclose(
        KalmanFilter(model).apply(channels, commands), -filtered[:, :4], atol=1e-9
    )
    result = Smoother(model).apply(channels, commands)
    np.testing.assert_allclose(result, -smoothed[:, :4], atol=1e-9)
    assert np.std(result + truth[:, :4]) < 0.95 * np.std(filtered[:, :4] - truth[:, :4])


def steady(speed: float, count: int = 1, offset: float = 0.0) -> Array:
    samples = np.zeros((count, 14))
    samples[
        :, [CHANNEL_NAMES.index(f"Car.{name}") for name in ("vx", "vFL", "vFR", "vRL", "vRR")]
    ] = speed
    samples[:, :6] += offset
    return samples


@pytest.mark.parametrize(("name", "condition"), SHIPPED)
def test_speeds_from_standstill_to_beyond_the_grid(name: str, condition: Condition) -> None:
    kalman = make(name, condition)
    speeds = np.concatenate(
        [np.zeros(50), np.linspace(0.0, 44.0, 1100), np.linspace(44.0, 0.0, 900), np.zeros(3000)]
    )
    largest = 0.0
    for speed, rate in zip(speeds, np.gradient(speeds, 0.01), strict=True):
        sample = steady(float(speed))[0]
        sample[CHANNEL_NAMES.index("Car.ax")] = rate
        if kalman.step(sample, PASSIVE):
            assert np.isfinite(kalman.estimate).all()
            assert (kalman.deviation > 0.0).all()
            largest = max(largest, float(np.abs(kalman.estimate).max()))
    assert largest < LARGEST
    assert np.abs(kalman.estimate).max() < 0.01  # quiet half a minute of standing later


def test_a_filter_that_leaves_what_a_suspension_can_do_starts_anew() -> None:
    kalman = make("kalman", "ideal")
    wild = steady(20.0)[0]
    wild[:6] = 1e6
    for _ in range(3):
        kalman.step(wild, PASSIVE)
    calm = steady(20.0)[0]
    valid = [kalman.step(calm, PASSIVE) for _ in range(600)]
    assert all(valid[-100:])
    assert np.abs(kalman.estimate).max() < 0.02


@pytest.mark.parametrize("condition", [c for name, c in SHIPPED if name == "kalman"])
def test_constant_channels_leave_nothing_in_the_end(condition: Condition) -> None:
    """Offsets of all inertial sensors, for as long as they stay: no drift."""
    kalman = make("kalman", condition)
    sample = steady(15.0, offset=0.005)[0]
    for _ in range(6000):
        kalman.step(sample, PASSIVE)
    early = np.abs(kalman.estimate).max()
    for _ in range(3000):
        kalman.step(sample, PASSIVE)
    late = np.abs(kalman.estimate).max()
    assert late < 2e-3
    assert late < 1.05 * early + 1e-6


def test_bad_samples_are_named_and_a_reset_forgets() -> None:
    kalman = make("kalman", "ideal")
    sample = steady(12.0)[0]
    kalman.step(sample, PASSIVE)
    first = kalman.estimate.copy()
    bad = sample.copy()
    bad[2] = np.nan
    with pytest.raises(SensorError, match=r"Car\.az is nan"):
        kalman.step(bad, PASSIVE)
    for k in range(20):
        kalman.step(sample + 0.01 * np.sin(k), np.ones(4))
    kalman.reset()
    assert np.isnan(kalman.estimate).all()
    assert np.isnan(kalman.deviation).all()
    kalman.step(sample, PASSIVE)
    assert np.array_equal(kalman.estimate, first)


def test_files_that_are_no_filter(tmp_path: Path) -> None:
    path = tmp_path / "other.npz"
    np.savez(path, weights=np.zeros(3))
    with pytest.raises(SensorError, match="cannot be read as a Kalman filter"):
        KalmanFilter.load(path)


def test_a_saved_model_is_the_same(tmp_path: Path) -> None:
    model = linear_model(0.5 * np.eye(6), np.eye(6)[:3], np.eye(6), np.eye(3))
    paths = [tmp_path / f"{k}.npz" for k in range(2)]
    for path in paths:
        model.save(path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    read = KalmanModel.load(paths[0])
    assert read.taps == 0
    for name, part in model.parts.items():
        np.testing.assert_allclose(read.parts[name], part, rtol=1e-3, atol=1e-6)
