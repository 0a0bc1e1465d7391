import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from click.testing import CliRunner, Result
from pydantic import ValidationError
from sensor_run import run_of

from cosim.cli import main
from sensor.dataset import Run, write_run
from sensor.errors import SensorError
from sensor.recipe import RECIPES, Recipe, RunSelection, TrainingRecipe, read_recipe
from sensor.runtime import OnnxSensor
from sensor.training import fit, learning_rate, train
from sensor.training_data import as_seen, read_parts


def linear_run(name: str, seed: int) -> Run:
    """A truth that is a moving average of some channels, with noise."""
    rng = np.random.default_rng(seed)
    channels = rng.normal(size=(600, 14)) * np.logspace(-1, 1, 14) + 1.0
    kernel = np.ones(3) / 3.0
    mixed = channels[:, :4] / np.logspace(-1, 1, 14)[:4]
    truth = 0.1 * np.stack([np.convolve(c, kernel)[:600] for c in mixed.T], axis=1)
    truth += rng.normal(scale=0.002, size=truth.shape)
    return run_of(name, channels, truth)


def make_recipe(**training: Any) -> Recipe:
    settings = {"epochs": 4, "batch_size": 64, "windows_per_epoch": 512, "validation_windows": 256}
    content = {
        "name": "small",
        "network": {"window": 5, "units": 12, "hidden": 16, "dropout": 0.1},
        "training": settings | {"learning_rate": 5e-3} | training,
        "runs": {"training": ["a", "b"], "validation": ["c"]},
    }
    return Recipe.model_validate(content)


TRAINING, VALIDATION = [linear_run("a", 1), linear_run("b", 2)], [linear_run("c", 3)]


@pytest.mark.parametrize("precision", ["fp32", "bf16"])
def test_training_reduces_the_error(tmp_path: Path, precision: str) -> None:
    recipe = make_recipe(epochs=8, windows_per_epoch=None, precision=precision)
    network, record = fit(recipe, TRAINING, VALIDATION, tmp_path, resume=False)
    errors = [epoch["validation_rmse"] for epoch in record["epochs"]]
    assert errors[-1] < 0.6 * errors[0]
    assert record["best_validation_rmse"] == min(errors)
    assert record["best_epoch"] == errors.index(min(errors)) + 1
    assert not network.training


def test_resumed_training_ends_in_the_same_weights(tmp_path: Path) -> None:
    whole, _ = fit(make_recipe(epochs=4), TRAINING, VALIDATION, tmp_path, resume=False)
    parts = tmp_path / "parts"
    parts.mkdir()
    fit(make_recipe(epochs=2), TRAINING, VALIDATION, parts, resume=False)
    torch.manual_seed(99)
    resumed, record = fit(make_recipe(epochs=4), TRAINING, VALIDATION, parts, resume=True)
    assert [epoch["epoch"] for epoch in record["epochs"]] == [1, 2, 3, 4]
    for name, value in whole.state_dict().items():
        assert torch.equal(value, resumed.state_dict()[name]), name
    with pytest.raises(SensorError, match="another recipe"):
        fit(make_recipe(batch_size=32), TRAINING, VALIDATION, parts, resume=True)


def test_every_draw_of_the_measurement_is_another_and_comes_again() -> None:
    recipe = make_recipe().model_copy(update={"condition": "production"})
    first, again, next_one = (as_seen(recipe, TRAINING, draw) for draw in (0, 0, 1))
    for run, same, other, ideal in zip(first, again, next_one, TRAINING, strict=True):
        np.testing.assert_array_equal(run.channels, same.channels)
        assert np.abs(run.channels - other.channels).max() > 0.01
        assert np.abs(run.channels - ideal.channels).max() > 0.01
    offsets = [np.mean(run.channels[:, 0] - run.stage[:, 0]) for run in first]
    assert abs(offsets[0] - offsets[1]) > 1e-3  # each run has its own


def test_runs_are_held_out(tmp_path: Path) -> None:
    for i in range(7):
        write_run(tmp_path / f"run_{i}.parquet", linear_run(f"run_{i}", i))
    selection = RunSelection(training=("run_*",), hold_out=3)
    training, validation = read_parts(tmp_path, selection)
    assert [run.name for run in validation] == ["run_2", "run_5"]
    assert [run.name for run in training] == ["run_0", "run_1", "run_3", "run_4", "run_6"]
    with pytest.raises(SensorError, match="of 8 runs one is held out"):
        read_parts(tmp_path, RunSelection(training=("run_*",), hold_out=8))
    with pytest.raises(ValidationError, match="either named"):
        RunSelection(training=("run_*",))


def test_train_writes_network_and_record(tmp_path: Path) -> None:
    for run in (*TRAINING, *VALIDATION):
        write_run(tmp_path / f"{run.name}.parquet", run)
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(make_recipe(epochs=1).model_dump_json())  # JSON is YAML
    out = tmp_path / "out"
    network = train(tmp_path, recipe, out)
    onnx_sensor = OnnxSensor(out / "small.onnx")
    record = json.loads((out / "training.json").read_text())
    assert onnx_sensor.info.metadata["training"] == record
    assert record["samples"] == {"training": {"a": 600, "b": 600}, "validation": {"c": 600}}
    channels = VALIDATION[0].channels
    with torch.no_grad():
        expected = network(torch.from_numpy(channels[:5])[None]).numpy()[0]
    estimate = onnx_sensor.apply(channels.astype(np.float64), np.full((len(channels), 4), 0.3))
    np.testing.assert_allclose(estimate[4], expected, rtol=0.0, atol=1e-5)


def command(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, ["sensor", *map(str, arguments)])


def test_command_reports_every_problem_and_exits_with_2(tmp_path: Path) -> None:
    recipe = tmp_path / "recipe.yaml"
    arguments = ("train", recipe, "--data", tmp_path, "--out", tmp_path / "out")
    for content, sentences in {
        "family: bilstm\nname: x\nseed: -1\nruns: {training: [a], validation: [b]}\nextra: 1\n": (
            "recipe.yaml: seed:",
            "recipe.yaml: extra:",
        ),
        "family: bilstm\nname: x\nruns: {training: [a], validation: [b]}\n": (
            "'a' matches no Parquet file",
        ),
        "family: bilsm\nname: x\n": ("family is 'bilsm'", "did you mean 'bilstm'?"),
        "name: x\n": ("family is None, where one of bilstm, carried, fir belongs",),
        "name: x\nname: y\n": ("no valid YAML",),
    }.items():
        recipe.write_text(content)
        result = command(*arguments)
        assert result.exit_code == 2
        for sentence in sentences:
            assert sentence in result.output
    result = command("train", tmp_path / "none.yaml", "--data", tmp_path, "--out", tmp_path)
    assert result.exit_code == 2
    assert "none.yaml: it cannot be read" in result.output


def test_commands_train_resume_and_export(tmp_path: Path) -> None:
    for run in (*TRAINING, *VALIDATION):
        write_run(tmp_path / f"{run.name}.parquet", run)
    recipe, out = tmp_path / "recipe.yaml", tmp_path / "out"
    arguments = ("train", recipe, "--data", tmp_path, "--out", out, "--seed", "5")
    recipe.write_text(make_recipe(epochs=1).model_dump_json())
    assert command(*arguments).exit_code == 0
    recipe.write_text(make_recipe(epochs=2).model_dump_json())
    assert command(*arguments, "--resume").exit_code == 0
    record = json.loads((out / "training.json").read_text())
    assert record["recipe"]["seed"] == 5
    assert [epoch["epoch"] for epoch in record["epochs"]] == [1, 2]
    assert command("export", out / "checkpoint.pt", "-o", tmp_path / "again.onnx").exit_code == 0
    assert (tmp_path / "again.onnx").read_bytes() == (out / "small.onnx").read_bytes()
    for file in (recipe, tmp_path / "none.pt"):
        result = command("export", file, "-o", tmp_path / "not.onnx")
        assert result.exit_code == 2
        assert "checkpoint" in result.output
    assert not (tmp_path / "not.onnx").exists()


def test_the_papers_recipe() -> None:
    recipe = read_recipe(RECIPES / "paper.yaml")
    assert recipe.network.model_dump() == {
        "channels": "raw", "window": 19, "units": 167, "hidden": 256, "dropout": 0.5,
    }  # fmt: skip
    assert (recipe.training.epochs, recipe.training.learning_rate) == (30, 1e-3)
    assert recipe.training.schedule == "cosine"  # docs/decisions/0004-training-schedule.md
    assert all(pattern.startswith("hockenheim") for pattern in recipe.runs.validation)
    assert not any("hockenheim" in pattern for pattern in recipe.runs.training)


def test_unreadable_recipes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SensorError, match="cannot be read"):
        read_recipe(tmp_path / "none.yaml")
    (tmp_path / "twice.yaml").write_text("name: x\nname: y\n")
    with pytest.raises(SensorError, match="valid YAML"):
        read_recipe(tmp_path / "twice.yaml")


def test_learning_rate_schedules() -> None:
    def rates(schedule: str) -> list[float]:
        settings = TrainingRecipe.model_validate({"epochs": 30, "schedule": schedule})
        return [learning_rate(settings, epoch) for epoch in range(30)]

    assert set(rates("constant")) == {1e-3}
    assert rates("step")[19:21] == pytest.approx([1e-3, 1e-4])
    cosine = rates("cosine")
    assert cosine[0] == 1e-3
    assert cosine == sorted(cosine, reverse=True)
    assert 0.0 < cosine[-1] < 1e-5
