from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner
from sensor_run import run_of

from sensor.baselines import FirFilter, StillWheels, Zero
from sensor.baselines.fit import fit_best, main
from sensor.body_motion import BodyMotion
from sensor.dataset import Run, write_run
from sensor.errors import SensorError
from sensor.metrics import evaluate
from sensor.recipe import FirRecipe

Array = npt.NDArray[np.float64]
WINDOW = 5
COMMANDS = np.full((1000, 4), 0.3)
TRUE_WEIGHTS = np.random.default_rng(7).normal(size=(WINDOW, 14, 4))
TRUE_BIAS = np.array([0.1, -0.2, 0.3, 0.0])


def known_run(name: str, count: int, seed: int) -> Run:
    """Channels of very different size, and as truth a known filter of them."""
    scale = np.logspace(-2, 1, 14)
    channels = np.random.default_rng(seed).normal(3.0 * scale, scale, (count, 14))
    channels = channels.astype(np.float32)
    truth = FirFilter(TRUE_WEIGHTS, TRUE_BIAS).apply(channels, COMMANDS[:count])
    truth[: WINDOW - 1] = 0.0
    return run_of(name, channels, truth)


def test_fir_recovers_a_known_filter() -> None:
    runs = [known_run("a", 900, 1), known_run("b", 700, 2), known_run("short", 3, 3)]
    fir = FirFilter.fit(runs, WINDOW, ridge=1e-12)
    np.testing.assert_allclose(fir.weights, TRUE_WEIGHTS, rtol=0.0, atol=1e-3)
    other = known_run("c", 500, 4)
    assert (
        evaluate(fir.apply(other.channels, COMMANDS[:500]), other.truth.astype(float)).overall.rmse
        < 1e-5
    )


def test_fir_streaming_equals_batch() -> None:
    fir = FirFilter(TRUE_WEIGHTS, TRUE_BIAS)
    samples = known_run("a", 60, 1).channels.astype(np.float64)
    expected = fir.apply(samples, COMMANDS[:60])
    for _ in range(2):
        streamed = []
        for k, sample in enumerate(samples):
            assert fir.step(sample, COMMANDS[0]) is (k >= WINDOW - 1)
            streamed.append(fir.estimate.copy())
        np.testing.assert_allclose(streamed, expected, rtol=0.0, atol=1e-12)
        fir.reset()
        assert np.isnan(fir.estimate).all()
    assert np.isnan(fir.apply(samples[:4], COMMANDS[:4])).all()


def test_fir_file_round_trip_and_mismatch(tmp_path: Path) -> None:
    FirFilter(TRUE_WEIGHTS, TRUE_BIAS, {"ridge": 0.5}).save(tmp_path / "fir.npz")
    fir = FirFilter.load(tmp_path / "fir.npz")
    np.testing.assert_array_equal(fir.weights, TRUE_WEIGHTS)
    np.testing.assert_array_equal(fir.bias, TRUE_BIAS)
    assert fir.training == {"ridge": 0.5}
    with np.load(tmp_path / "fir.npz") as content:
        arrays = dict(content)
    arrays["metadata"] = np.array(str(arrays["metadata"]).replace("Car.az", "Car.aZ"))
    np.savez(tmp_path / "other.npz", **arrays)
    with pytest.raises(SensorError, match=r"'Car\.aZ', where 'Car\.az'"):
        FirFilter.load(tmp_path / "other.npz")
    (tmp_path / "bad.npz").write_text("nothing")
    with pytest.raises(SensorError, match="cannot be read"):
        FirFilter.load(tmp_path / "bad.npz")


def test_best_ridge_is_chosen_in_validation() -> None:
    training, validation = [known_run("a", 300, 1)], [known_run("b", 300, 2)]
    fir = fit_best(FirRecipe(window=WINDOW, ridges=(1e3, 1e-9, 1.0)), training, validation)
    assert fir.training["ridge"] == 1e-9
    assert fir.training["validation_rmse"] < 1e-4


def test_fit_command(tmp_path: Path) -> None:
    for name, seed in (("a", 1), ("b", 2)):
        write_run(tmp_path / f"{name}.parquet", known_run(name, 300, seed))
    recipe = tmp_path / "r.yaml"
    recipe.write_text("name: t\nfir: {window: 5}\nruns: {training: [a], validation: [b]}\n")
    arguments = ["--data", str(tmp_path), "--recipe", str(recipe), "--out", str(tmp_path / "m")]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    assert FirFilter.load(tmp_path / "m" / "fir_w5.npz").window == WINDOW
    recipe.write_text("name: t\nfirr: {}\nruns: {training: [a], validation: [nothing]}\n")
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 2
    assert "firr" in result.output


def test_zero_scores_nothing() -> None:
    zero = Zero()
    assert np.isnan(zero.estimate).all()
    assert zero.step(np.zeros(14), COMMANDS[0])
    np.testing.assert_array_equal(zero.estimate, 0.0)
    truth = np.random.default_rng(0).normal(size=(50, 4))
    assert evaluate(
        zero.apply(np.zeros((50, 14)), COMMANDS[:50]), truth
    ).overall.accuracy == pytest.approx(0.0)


def test_still_wheels_is_the_body_motion() -> None:
    samples = np.random.default_rng(1).normal(size=(80, 14))
    baseline = StillWheels()
    for k, expected in enumerate(BodyMotion().apply(samples)):
        assert baseline.step(samples[k], COMMANDS[k])
        np.testing.assert_allclose(baseline.estimate, expected, atol=1e-13)
    samples[0, 2] = np.nan
    with pytest.raises(SensorError, match=r"Car\.az is nan"):
        baseline.step(samples[0], COMMANDS[0])
    baseline.reset()
    assert np.isnan(baseline.estimate).all()
