import json

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sensor.errors import SensorError
from sensor.metrics import accuracy, evaluate, nrmse, rmse

Array = npt.NDArray[np.float64]
velocities = arrays(np.float64, (6, 4), elements=st.floats(-2.0, 2.0, width=32))


def test_by_hand() -> None:
    truth = np.tile([[0.3], [-0.4]], (1, 4))
    estimate = truth.copy()
    estimate[0, 0] += 0.1
    estimate[1, 1] += 0.5
    metrics = evaluate(estimate, truth)
    front_left, front_right, rear_left, _ = metrics.wheels
    assert metrics.samples == 2
    assert front_left.rmse == pytest.approx(0.1 / np.sqrt(2))
    assert front_left.truth_rms == pytest.approx(0.25 * np.sqrt(2))
    assert front_left.accuracy == pytest.approx(80.0)
    assert front_left.sign_agreement == 100.0
    assert front_right.sign_agreement == 50.0
    assert rear_left.accuracy == pytest.approx(100.0)
    assert metrics.overall.rmse == pytest.approx(np.sqrt(0.26 / 8))
    assert metrics.overall.max_abs_error == pytest.approx(0.5)


def test_error_band_holds_the_central_95_percent() -> None:
    truth = np.zeros((1001, 4))
    estimate = np.tile(np.linspace(-1.0, 1.0, 1001)[:, np.newaxis], (1, 4))
    overall = evaluate(estimate, truth).overall
    assert (overall.error_low, overall.error_high) == pytest.approx((-0.95, 0.95), abs=1e-3)


def test_accuracy_is_flagged_where_the_truth_hardly_moves() -> None:
    still = evaluate(np.zeros((5, 4)), np.zeros((5, 4)))
    assert still.overall.accuracy is None
    assert not still.overall.accuracy_meaningful
    assert not evaluate(np.zeros((5, 4)), np.full((5, 4), 0.009)).overall.accuracy_meaningful
    assert evaluate(np.zeros((5, 4)), np.full((5, 4), 0.011)).overall.accuracy_meaningful


def test_invalid_rows_are_left_out() -> None:
    truth = np.ones((5, 4))
    estimate = truth.copy()
    estimate[:2] = np.nan
    assert evaluate(estimate, truth).samples == 3
    estimate[2] = 9.0
    valid = np.array([False, False, False, True, True])
    metrics = evaluate(estimate, truth, valid)
    assert metrics.overall.rmse == 0.0
    json.dumps(metrics.to_dict(), allow_nan=False)


def test_what_cannot_be_compared_is_refused() -> None:
    with pytest.raises(SensorError, match="none of the 3"):
        evaluate(np.full((3, 4), np.nan), np.zeros((3, 4)))
    with pytest.raises(SensorError, match="samples, 4"):
        evaluate(np.zeros((3, 3)), np.zeros((3, 4)))
    with pytest.raises(SensorError, match="marked valid"):
        evaluate(np.full((3, 4), np.nan), np.zeros((3, 4)), np.ones(3, dtype=np.bool_))


@given(velocities, velocities)
def test_zero_estimate_scores_zero_and_truth_scores_100(truth: Array, other: Array) -> None:
    if nrmse(truth, truth) is None:
        return
    assert accuracy(truth, truth) == 100.0
    assert accuracy(np.zeros_like(truth), truth) == pytest.approx(0.0, abs=1e-9)
    assert rmse(other, truth) == pytest.approx(rmse(truth, other))


@given(velocities, velocities)
def test_overall_pools_the_wheels(truth: Array, estimate: Array) -> None:
    metrics = evaluate(estimate, truth)
    pooled = np.sqrt(np.mean([wheel.rmse**2 for wheel in metrics.wheels]))
    assert metrics.overall.rmse == pytest.approx(pooled)
    assert metrics.overall.max_abs_error == max(wheel.max_abs_error for wheel in metrics.wheels)
    assert metrics.overall.error_low <= metrics.overall.error_high
