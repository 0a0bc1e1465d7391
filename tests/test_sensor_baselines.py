from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner
from sensor_run import run_of

from sensor.ablation import GROUPS, ablation
from sensor.baselines import FirFilter, StillWheels, Zero
from sensor.baselines.fit import FILTERS, Shape, equations, fit_best, main
from sensor.baselines.normal_equations import Features, NormalEquations, Samples, Standard
from sensor.body_motion import BodyMotion
from sensor.conditions import CONDITIONS, Condition
from sensor.dataset import Run, write_run
from sensor.errors import SensorError
from sensor.features import residuals
from sensor.metrics import evaluate

Array = npt.NDArray[np.float64]
WINDOW = 5
RAW = Shape(WINDOW, "raw")
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


def moving_run(name: str, count: int, seed: int) -> Run:
    """Driving straight on at changing speed, its wheels 20 mm/s off: what residuals are made for.

    The truth is a filter of two residuals and Car.az; raw wheel speeds hide it behind the driving.
    """
    random = np.random.default_rng(seed)
    channels = random.normal(0.0, 1e-3, (count, 14))
    channels[:, 2] *= 100.0
    channels[:, 6] = 20.0 + 5.0 * np.sin(np.arange(count) / 50.0)
    channels[:, 9:13] = channels[:, [6]] + random.normal(0.0, 0.02, (count, 4))
    truth = np.zeros((count, 4))
    truth[:, 0] = 0.5 * residuals(channels)[:, 0] + 0.01 * channels[:, 2]
    truth[:, 3] = -0.3 * residuals(channels)[:, 3]
    return run_of(name, channels, truth)


def fitted(runs: list[Run], ridge: float = 1e-12) -> FirFilter:
    return fit_best(RAW, "ideal", runs, runs, (ridge,))


def test_fir_recovers_a_known_filter() -> None:
    fir = fitted([known_run("a", 900, 1), known_run("b", 700, 2), known_run("short", 3, 3)])
    np.testing.assert_allclose(fir.weights, TRUE_WEIGHTS, rtol=0.0, atol=1e-3)
    other = known_run("c", 500, 4)
    estimate = fir.apply(other.channels, COMMANDS[:500])
    assert evaluate(estimate, other.truth.astype(float)).overall.rmse < 1e-5


@pytest.mark.parametrize("condition", CONDITIONS)
@pytest.mark.parametrize("floor", [None, 0.5])
def test_normal_equations_against_every_window_written_out(
    condition: Condition, floor: float | None
) -> None:
    samples = Samples([known_run("a", 60, 1), known_run("b", 41, 2)], condition, "residual", 2)
    standard = Standard.of(samples)
    equations = NormalEquations.of(samples, WINDOW, standard, floor)
    rows, targets = [], []
    for features, truth in samples:
        weight = 1.0 if floor is None else 1.0 / np.sqrt(np.mean(truth**2) + floor**2)
        x = (features - standard.input_mean) / standard.input_std
        y = (truth - standard.output_mean) / standard.output_std
        for k in range(WINDOW - 1, len(x)):
            rows.append(weight * np.append(x[k - WINDOW + 1 : k + 1].reshape(-1), 1.0))
            targets.append(weight * y[k])
    a, b = np.array(rows), np.array(targets)
    assert len(a) == (1 if condition == "ideal" else 2) * (56 + 37)
    assert equations.count == pytest.approx(np.sum(a[:, -1] ** 2))
    np.testing.assert_allclose(equations.gram, a.T @ a, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(equations.moment, a.T @ b, rtol=0.0, atol=1e-9)
    weights = np.random.default_rng(0).normal(size=(a.shape[1], 4))
    error = (a @ weights - b) * standard.output_std
    mean_square = np.sum(error**2, axis=0) / equations.count
    np.testing.assert_allclose(equations.rmse(weights), np.sqrt(mean_square))
    ridge = 1e-2
    penalty = ridge * equations.count * np.eye(a.shape[1])
    penalty[-1, -1] = 0.0
    stacked = np.vstack([a, np.sqrt(penalty)])
    expected = np.linalg.lstsq(stacked, np.vstack([b, np.zeros((a.shape[1], 4))]), rcond=None)[0]
    np.testing.assert_allclose(equations.solve(ridge), expected, rtol=0.0, atol=1e-9)


def test_mean_and_deviation_against_numpy() -> None:
    samples = Samples([known_run("a", 60, 1), known_run("b", 41, 2)])
    features = np.vstack([x for x, _ in samples])
    standard = Standard.of(samples)
    np.testing.assert_allclose(standard.input_mean, features.mean(axis=0))
    np.testing.assert_allclose(standard.input_std, features.std(axis=0))
    with pytest.raises(SensorError, match="no run"):
        Standard.of(Samples([]))
    with pytest.raises(SensorError, match="window of 200"):
        NormalEquations.of(samples, 200, standard)


def test_production_runs_are_measured_anew_each_time() -> None:
    run = known_run("a", 30, 1)
    first, second = (x for x, _ in Samples([run], "production", "raw", 2))
    assert (first != second).any(axis=0).all()
    np.testing.assert_array_equal(first, next(iter(Samples([run], "production")))[0])


def test_residual_channels_show_what_raw_ones_hide() -> None:
    training, unseen = [moving_run("a", 900, 1)], moving_run("b", 400, 2)
    errors = {}
    for kind in ("raw", "residual"):
        fir = fit_best(Shape(WINDOW, kind), "ideal", training, training, (1e-3,))
        estimate = fir.apply(unseen.channels, unseen.commands)
        errors[kind] = evaluate(estimate, unseen.truth.astype(float)).overall.rmse
        assert fir.channels == kind
    assert errors["residual"] < 0.5 * errors["raw"]


def test_ablation_names_the_channels_that_carry_the_truth() -> None:
    training, unseen = [moving_run("a", 900, 1)], [moving_run("b", 400, 2)]
    shape = Shape(WINDOW, "residual")
    found = {a.without: a for a in ablation("ideal", training, unseen, shape, (1e-9, 1e-6))}
    assert set(found) == {None, *GROUPS}
    whole = found[None]
    assert whole.accuracy > 99.0
    assert found["steering angles"].rmse == pytest.approx(whole.rmse, abs=1e-5)
    assert found["wheel speeds"].rmse > found["IMU accelerations"].rmse > 10.0 * whole.rmse
    # what is left without the wheel speeds is the truth that they make
    made = 0.02 * np.sqrt((0.5**2 + 0.3**2) / 4.0)
    assert found["wheel speeds"].rmse == pytest.approx(made, rel=0.1)
    assert whole.rmse == pytest.approx(np.sqrt(np.mean(np.square(whole.wheels))))


def test_leaving_channels_out_is_fitting_without_them() -> None:
    """Against a fit to runs in which those channels never move."""
    runs = [known_run("a", 300, 1)]
    still = [run_of("a", np.where(np.arange(14) < 3, 1.0, runs[0].channels), runs[0].truth)]
    full, _ = equations(RAW, "ideal", runs, runs)
    fewer, _ = equations(RAW, "ideal", still, still)
    np.testing.assert_allclose(
        full.without([0, 1, 2]).solve(1e-6), fewer.solve(1e-6), rtol=0.0, atol=1e-9
    )


@pytest.mark.parametrize("kind", ["raw", "residual"])
def test_fir_streaming_equals_batch(kind: Features) -> None:
    fir = FirFilter(TRUE_WEIGHTS, TRUE_BIAS, channels=kind)
    samples = moving_run("a", 60, 1).channels.astype(np.float64)
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
    bad = samples[0].copy()
    bad[6] = np.nan
    with pytest.raises(SensorError, match=r"Car\.vx is nan\.$"):
        fir.step(bad, COMMANDS[0])


def test_fir_file_round_trip_and_mismatch(tmp_path: Path) -> None:
    FirFilter(TRUE_WEIGHTS, TRUE_BIAS, {"ridge": 0.5}, "residual").save(tmp_path / "fir.npz")
    fir = FirFilter.load(tmp_path / "fir.npz")
    np.testing.assert_array_equal(fir.weights, TRUE_WEIGHTS.astype(np.float32))
    np.testing.assert_array_equal(fir.bias, TRUE_BIAS.astype(np.float32))
    assert fir.channels == "residual"
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
    fir = fit_best(RAW, "ideal", training, validation, (1e3, 1e-9, 1.0))
    assert fir.training["ridge"] == 1e-9
    assert fir.training["validation_rmse"] < 1e-4


def test_fit_command(tmp_path: Path) -> None:
    for name, seed in (("a", 1), ("b", 2)):
        write_run(tmp_path / f"{name}.parquet", known_run(name, 300, seed))
    recipe = tmp_path / "r.yaml"
    recipe.write_text("{family: fir, name: t, runs: [a, b], hold_out: 2}")
    arguments = ["--data", str(tmp_path), "--recipe", str(recipe), "--out", str(tmp_path / "m")]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    files = {path.stem for path in (tmp_path / "m").iterdir()}
    assert files == {f"{name}_{condition}" for name in FILTERS for condition in CONDITIONS}
    fir = FirFilter.load(tmp_path / "m" / "fir_residual_w64_production.npz")
    assert (fir.window, fir.channels) == (64, "residual")
    assert fir.training["command"].endswith("--recipe r.yaml")
    assert (fir.training["training_runs"], fir.training["validation_runs"]) == (1, ["b"])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("{family: fir, name: t, ridge: 1}", "ridge: Extra inputs are not permitted (got 1)."),
        ("{family: fir, name: t, runs: [x]}", "'x' matches no Parquet file."),
        ("{family: fir, name: t, hold_out: 3}", "of 3 runs one is for validation, but there are 1"),
        ("{family", "it is no valid YAML"),
    ],
)
def test_a_recipe_that_does_not_fit(tmp_path: Path, text: str, sentence: str) -> None:
    write_run(tmp_path / "a.parquet", known_run("a", 30, 1))
    recipe = tmp_path / "r.yaml"
    recipe.write_text(text)
    arguments = ["--data", str(tmp_path), "--recipe", str(recipe), "--out", str(tmp_path / "m")]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 2
    assert sentence in result.output
    assert "Traceback" not in result.output


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
