"""Modes, bands, projection, deviation and pooling, against analytic signals."""

from dataclasses import asdict

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sensor.metrics import (
    BANDS,
    MODES,
    WIDTH,
    Match,
    by_band,
    by_mode,
    coverage,
    evaluate,
    pool,
    projected,
    rms,
)

Array = npt.NDArray[np.float64]
TIME = np.arange(2000) / 100.0
velocities = arrays(
    np.float64, st.tuples(st.integers(1, 60), st.just(4)), elements=st.floats(-2.0, 2.0, width=32)
)


def at_wheels(values: Array, signs: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)) -> Array:
    return np.outer(values, signs)


@pytest.mark.parametrize("mode", MODES)
def test_a_pure_mode_is_found_in_its_place_only(mode: str) -> None:
    truth = at_wheels(0.1 * np.sin(2 * np.pi * TIME), MODES[mode])
    found = by_mode(0.75 * truth, truth)
    for name, match in found.items():
        there = 0.1 / np.sqrt(2) if name == mode else 0.0
        assert match.truth_rms == pytest.approx(there, abs=1e-12)
        assert match.rmse == pytest.approx(0.25 * there, abs=1e-12)
    assert found[mode].accuracy == pytest.approx(75.0)


def test_modes_have_the_signs_of_their_names() -> None:
    left_up_diagonal = np.array([[1.0, -1.0, -1.0, 1.0]])
    assert by_mode(left_up_diagonal, left_up_diagonal)["warp"].truth_rms == 1.0
    left, front = np.array([[1.0, 0.0, 1.0, 0.0]]), np.array([[1.0, 1.0, 0.0, 0.0]])
    assert by_mode(left, left)["roll"].truth_rms == 0.5
    assert by_mode(front, front)["pitch"].truth_rms == 0.5


@given(velocities)
def test_squares_of_modes_and_of_bands_add_up(truth: Array) -> None:
    for parts in (by_mode(np.zeros_like(truth), truth), by_band(np.zeros_like(truth), truth)):
        total = sum(match.rmse**2 for match in parts.values())
        assert np.sqrt(total) == pytest.approx(rms(truth), abs=1e-12)
        assert all(match.rmse == pytest.approx(match.truth_rms) for match in parts.values())


@pytest.mark.parametrize("frequency", [0.2, 1.3, 4.0, 14.8, 33.0])
def test_a_tone_is_found_in_its_band(frequency: float) -> None:
    truth = at_wheels(np.sin(2 * np.pi * frequency * TIME + 0.4))
    bands = by_band(0.9 * truth, truth)
    (band,) = (name for name, (low, high) in BANDS.items() if low <= frequency < high)
    assert bands[band].truth_rms ** 2 == pytest.approx(0.5, rel=0.02)
    assert bands[band].accuracy == pytest.approx(90.0)
    # The mirrored run has a kink and no step: what leaks out falls with the fourth power.
    assert max(m.truth_rms**2 for name, m in bands.items() if name != band) < 0.005


def test_a_drift_does_not_leak_into_the_high_bands() -> None:
    truth = at_wheels(TIME)  # begins at 0 and ends at 20
    bands = by_band(np.zeros_like(truth), truth)
    assert bands["driving"].truth_rms == pytest.approx(rms(truth), rel=1e-4)
    assert bands["above"].truth_rms < 1e-5 * rms(truth)


def test_white_noise_fills_the_bands_by_their_widths() -> None:
    noise = np.random.default_rng(3).normal(size=(100_000, 4))
    for name, match in by_band(np.zeros_like(noise), noise).items():
        low, high = BANDS[name]
        assert match.truth_rms**2 == pytest.approx((high - low) / 50.0, rel=0.03)


def test_one_sample_has_no_frequency() -> None:
    bands = by_band(np.zeros((1, 4)), np.ones((1, 4)))
    assert bands["driving"].truth_rms == pytest.approx(1.0)
    assert bands["above"].accuracy is None


def test_projection_adds_the_presumed_share_of_the_speed() -> None:
    still, speed = np.zeros((100, 4)), np.full(100, 50.0 / 3.6)
    on_target = projected(still, still + 0.01, speed + 0.02, speed)
    share = np.sin(np.deg2rad(0.45))
    assert share == pytest.approx(0.0079, abs=5e-5)
    assert on_target.truth_rms == pytest.approx(50.0 / 3.6 * share + 0.01)
    assert on_target.rmse == pytest.approx(0.01 - 0.02 * share)


def test_coverage_of_a_normal_error() -> None:
    error = np.random.default_rng(1).normal(size=(500_000, 4)) * [1.0, 2.0, 1.0, 1.0]
    deviation = np.ones_like(error) * [1.0, 2.0, 0.5, 2.0]
    share = coverage(error, deviation)
    assert share is not None
    # P(|x| < 1.645 k) of a normal distribution, for k = 1, 1, 1/2 and 2
    assert share == pytest.approx([90.0, 90.0, 58.9, 99.9], abs=0.3)


def test_coverage_is_none_without_a_deviation_and_counts_a_missing_one_as_not_covered() -> None:
    error = np.zeros((4, 4))
    assert coverage(error, np.full((4, 4), np.nan)) is None
    deviation = np.ones((4, 4))
    deviation[0, 0] = np.nan
    assert coverage(error, deviation) == pytest.approx([75.0, 100.0, 100.0, 100.0])
    assert coverage(error + 1.0001 * WIDTH, np.ones((4, 4))) == pytest.approx([0.0] * 4)


def record(estimate: Array, truth: Array) -> dict[str, object]:
    speed = np.full(len(truth), 20.0)
    found = evaluate(estimate, truth).to_dict()
    for group, parts in (("modes", by_mode(estimate, truth)), ("bands", by_band(estimate, truth))):
        found[group] = {name: part.to_dict() for name, part in parts.items()}
    found["projected"] = projected(estimate, truth, speed, speed).to_dict()
    found["coverage"] = {"VRel.FL": 100.0 * float(np.mean(np.abs(estimate - truth)[:, 0] < 0.03))}
    return found


def test_pooled_runs_have_the_figures_of_one_long_run() -> None:
    random = np.random.default_rng(7)
    truth = random.normal(size=(900, 4)) * 0.05
    estimate = truth + random.normal(size=truth.shape) * np.linspace(0.0, 0.1, 900)[:, np.newaxis]
    parts = [record(estimate[rows], truth[rows]) for rows in (slice(0, 250), slice(250, None))]
    pooled, whole = pool(parts), record(estimate, truth)
    assert pooled["samples"] == 900
    for group in ("wheels", "modes"):
        for name, figures in pooled[group].items():
            assert figures["rmse"] == pytest.approx(whole[group][name]["rmse"])  # type: ignore[index]
    for name, value in pooled["overall"].items():
        assert value == pytest.approx(whole["overall"][name])  # type: ignore[index]
    for name in ("rmse", "truth_rms", "accuracy"):
        assert pooled["projected"][name] == pytest.approx(whole["projected"][name])  # type: ignore[index]
    assert pooled["coverage"] == pytest.approx(whole["coverage"])
    squares = sum(band["rmse"] ** 2 for band in pooled["bands"].values())
    assert np.sqrt(squares) == pytest.approx(pooled["overall"]["rmse"])


def test_pooling_runs_without_a_deviation_or_without_motion() -> None:
    still = record(np.zeros((5, 4)), np.zeros((5, 4)))
    moving = record(np.ones((5, 4)), np.ones((5, 4)))
    assert pool([still])["overall"]["sign_agreement"] is None
    assert pool([still])["overall"]["accuracy"] is None
    assert pool([still, moving])["overall"]["sign_agreement"] == 100.0
    moving["coverage"] = None
    assert pool([still, moving])["coverage"] is None


def test_match_flags_a_truth_that_hardly_moves() -> None:
    assert not Match(0.001, 0.009).accuracy_meaningful
    assert Match(0.001, 0.011).accuracy_meaningful
    assert Match(0.001, 0.0).accuracy is None
    assert asdict(Match(0.1, 0.2)) == {"rmse": 0.1, "truth_rms": 0.2}
