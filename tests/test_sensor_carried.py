"""The network with carried state: features from first principles, the graph equal to torch."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from sensor.carried.features import FeatureConfig, features, slow_mean, taken
from sensor.carried.graph import export_carried
from sensor.carried.mirror import Mirror
from sensor.carried.network import CarriedConfig, CarriedNetwork
from sensor.carried.recipe import CarriedRecipe, Schedule, Shape
from sensor.carried.runtime import CarriedSensor
from sensor.carried.streams import Sequence4, Streams
from sensor.carried.training import Trainer, export_checkpoint
from sensor.channels import CHANNEL_NAMES
from sensor.checkpoint import load, save
from sensor.dataset import Run, split
from sensor.errors import SensorError
from sensor.features import WHEEL_SPEEDS

VX = CHANNEL_NAMES.index("Car.vx")
AZ = CHANNEL_NAMES.index("Car.az")


def drive(samples: int, seed: int = 1, speed: float = 15.0) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    channels = random.normal(scale=0.2, size=(samples, 14))
    channels[:, [3, 4, 5, 7, 8, 13]] *= 0.1
    channels[:, VX] = speed
    channels[:, WHEEL_SPEEDS] = speed + random.normal(scale=0.02, size=(samples, 4))
    return channels, random.uniform(size=(samples, 4))


def small() -> CarriedNetwork:
    torch.manual_seed(3)
    network = CarriedNetwork(CarriedConfig(front=8, units=12, hidden=6))
    network.mean.uniform_(-0.1, 0.1)
    network.std.uniform_(0.5, 2.0)
    network.calibration.uniform_(0.5, 1.5)
    return network.eval()


def column(name: str) -> int:
    return FeatureConfig().names.index(name)


def test_an_impulse_at_the_front_comes_back_one_wheelbase_later() -> None:
    channels, commands = np.zeros((200, 14)), np.zeros((200, 4))
    channels[:, VX] = speed = 10.0
    channels[:, WHEEL_SPEEDS] = speed
    channels[50, AZ] = 1.0
    # neither level nor mean: nothing but the delay
    steady = FeatureConfig(bias_time=100.0, level_time=1e6, largest=1e6)
    rows = features(channels, commands, steady)
    delay = 2.675 / speed * 100.0  # samples
    for lead in (0, 4):
        heard = rows[:, column(f"az@{lead:+d}")]
        loud = np.flatnonzero(np.abs(heard) > 0.2 * np.abs(heard).max())
        centre = (heard[loud] * loud).sum() / heard[loud].sum()
        assert centre == pytest.approx(50 + delay - lead, abs=0.02)


def test_slow_errors_of_wheels_and_imu_vanish() -> None:
    channels, commands = drive(6000)
    worn = channels.copy()
    worn[:, WHEEL_SPEEDS[0]] *= 1.004  # a wheel 0.4 % too small
    worn[:, AZ] += 0.5
    difference = (features(worn, commands) - features(channels, commands))[-1000:]
    assert np.abs(difference[:, column("Residual.FL")]).max() < 0.1  # of 60 mm/s, 3 units
    assert np.abs(difference[:, column("az")]).max() < 0.1


def test_twice_the_motion_is_the_same_picture_at_twice_the_level() -> None:
    channels, commands = drive(3000)
    moving = list(range(6))
    twice = channels.copy()
    twice[:, moving] *= 2.0
    twice[:, WHEEL_SPEEDS] += twice[:, WHEEL_SPEEDS] - twice[:, [VX]]
    quiet = FeatureConfig(least_level=1e-6)
    one, two = (features(c, commands, quiet)[500:] for c in (channels, twice))
    first = column("Residual.FL")
    residual = slice(first, first + 4)
    for part in (slice(first + 4, first + 10), residual):
        assert np.median(np.abs(one[:, part] - two[:, part])) < 0.02
    assert np.median(two[:, -1] / one[:, -1]) == pytest.approx(2.0, abs=0.02)


def test_the_mirror_image_of_a_drive_straight_ahead() -> None:
    """Without yaw rate, where the centre of gravity's place does not count, the features of the
    mirrored channels are the mirrored features.
    """
    channels, commands = drive(400)
    channels[:, CHANNEL_NAMES.index("Car.YawRate")] = 0.0
    commands = commands * np.array([1.0, 0.8, 0.6, 0.4])
    sides = {"FL": "FR", "FR": "FL", "RL": "RR", "RR": "RL"}
    names = [n[:-2] + sides.get(n[-2:], n[-2:]) for n in CHANNEL_NAMES]
    turned = channels[:, [CHANNEL_NAMES.index(name) for name in names]]
    for name in ("ay", "RollVel", "SteerAngleFL", "SteerAngleFR"):
        turned[:, CHANNEL_NAMES.index(f"Car.{name}")] *= -1.0
    turned[:, CHANNEL_NAMES.index("Steer.WhlAng")] *= -1.0
    truth = np.arange(1600, dtype=np.float32).reshape(400, 4)
    run = Sequence4(features(channels, commands), truth, 1.0)
    image = Mirror(FeatureConfig()).image(run)
    wanted = features(turned, commands[:, [1, 0, 3, 2]])
    assert np.abs(wanted - run.features).max() > 0.1
    np.testing.assert_allclose(image.features, wanted, atol=1e-5)
    np.testing.assert_array_equal(image.truth, truth[:, [1, 0, 3, 2]])


def test_slow_mean_starts_as_the_mean_of_all() -> None:
    x = np.arange(10.0)[:, None]
    assert slow_mean(x, 1.0, 0.0)[:, 0] == pytest.approx(x[:, 0] / 2)
    assert slow_mean(np.ones((5000, 1)), 0.5, 0.1)[-1, 0] == pytest.approx(1.0)
    assert slow_mean(np.ones((10, 1)), 1.0, 0.1)[9, 0] == pytest.approx(0.5)


def test_age_between_samples() -> None:
    source = np.arange(1.0, 11.0)[:, None]
    assert taken(source, np.full(10, 2.5))[4:, 0] == pytest.approx([2.5, 3.5, 4.5, 5.5, 6.5, 7.5])
    assert taken(source, np.full(10, 3.0))[:, 0] == pytest.approx([0, 0, 0, 1, 2, 3, 4, 5, 6, 7])
    t = np.arange(200) / 100.0
    wave = np.sin(2 * np.pi * 10.0 * t)[:, None]
    late = np.sin(2 * np.pi * 10.0 * (t - 0.0637))
    assert taken(wave, np.full(200, 6.37))[20:, 0] == pytest.approx(late[20:], abs=0.01)


def test_the_graph_streams_what_torch_computes(tmp_path: Path) -> None:
    network = small()
    sensor = CarriedSensor(export_carried(network, tmp_path / "n.onnx"))
    channels, commands = drive(300)
    channels[:, VX] = np.linspace(0.0, 40.0, 300)
    channels[:, WHEEL_SPEEDS] = channels[:, [VX]]
    got, deviation = sensor.apply_with_deviation(channels, commands)
    with torch.no_grad():
        want, spread, _ = network(torch.from_numpy(features(channels, commands))[:, None])
    assert np.isnan(got[: sensor.warm_up]).all()
    first = sensor.warm_up
    assert got[first:] == pytest.approx(want[first:, 0].numpy(), abs=1e-5)
    assert deviation[first:] == pytest.approx(spread[first:, 0].numpy(), abs=1e-5)


def test_reset_forgets_and_steps_are_deterministic(tmp_path: Path) -> None:
    sensor = CarriedSensor(export_carried(small(), tmp_path / "n.onnx"))
    channels, commands = drive(80)
    first = sensor.apply(channels, commands)
    for k in range(30):
        sensor.step(channels[k], commands[k])
    sensor.reset()
    assert np.isnan(sensor.estimate).all()
    assert np.array_equal(sensor.apply(channels, commands), first, equal_nan=True)


def test_a_bad_sample_is_refused_and_not_taken(tmp_path: Path) -> None:
    sensor = CarriedSensor(export_carried(small(), tmp_path / "n.onnx"))
    channels, commands = drive(60)
    want = sensor.apply(channels, commands)
    for k in range(60):
        if k == 40:
            bad = channels[k].copy()
            bad[AZ] = np.nan
            with pytest.raises(SensorError, match=r"Car\.az is nan"):
                sensor.step(bad, commands[k])
        sensor.step(channels[k], commands[k])
    assert np.array_equal(sensor.estimate, want[-1])


def test_a_wrong_graph_is_not_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from sensor.carried import graph

    monkeypatch.setattr(graph, "_TORCH_TO_ONNX_GATES", [0, 1, 2, 3])
    with pytest.raises(SensorError, match="differ"):
        export_carried(small(), tmp_path / "n.onnx")
    assert not list(tmp_path.iterdir())


def test_streams_play_every_run_once_from_its_start() -> None:
    random = np.random.default_rng(0)
    runs = [
        Sequence4(np.full((n, 3), i, dtype=np.float32), np.full((n, 4), i, dtype=np.float32), 1.0)
        for i, n in enumerate((250, 90, 420, 130, 333))
    ]
    seen = np.zeros(len(runs))
    for chunk in Streams(count=3, chunk=50, warm_up=10).chunks(runs, random):
        assert np.array_equal(chunk.features[..., 0], chunk.truth[..., 0])
        for stream in range(3):
            counted = chunk.weight[:, stream, 0] > 0
            for index in np.unique(chunk.truth[counted, stream, 0]):
                seen[int(index)] += counted.sum()
    assert list(seen) == [240, 80, 410, 120, 323]


def runs_of_a_known_plant(count: int, samples: int) -> list[Run]:
    """v_rel of every wheel is a low-pass of a_z: what a state must be carried for."""
    runs = []
    for seed in range(count):
        channels, commands = drive(samples, seed)
        velocity = np.zeros(samples)
        for k in range(1, samples):
            velocity[k] = 0.9 * velocity[k - 1] + 0.1 * channels[k, AZ]
        truth = np.repeat(velocity[:, None], 4, axis=1)
        parts = (channels, np.zeros((samples, 11)), commands, truth, np.zeros((samples, 4)))
        runs.append(Run(f"run_{seed:02d}", *(part.astype(np.float32) for part in parts)))
    return runs


def recipe(epochs: int, coarse: int = 0) -> CarriedRecipe:
    return CarriedRecipe(
        family="carried", name="test", condition="ideal", hold_out=4,
        network=Shape(front=8, units=12, hidden=8),
        training=Schedule(epochs=epochs, streams=4, chunk=25, learning_rate=2e-2,
                          coarse_epochs=coarse, mirror=coarse > 0),
    )  # fmt: skip


def test_training_learns_and_resumes_to_the_same_weights(tmp_path: Path) -> None:
    training, held = split(runs_of_a_known_plant(12, 400), 4)
    assert [run.name for run in held] == ["run_03", "run_07", "run_11"]
    whole = Trainer(recipe(6), training, held)
    first = Trainer(recipe(6), training, held)
    for epoch in range(6):
        whole.run_epoch(epoch)
        if epoch < 3:
            first.run_epoch(epoch)
    save(first, tmp_path / "checkpoint.pt")
    second = Trainer(recipe(6), training, held)
    load(second, tmp_path / "checkpoint.pt")
    for epoch in range(3, 6):
        second.run_epoch(epoch)
    assert whole.reached.best < 0.7 * whole.reached.epochs[0]["validation_error"]
    for name, weights in whole.network.state_dict().items():
        assert torch.equal(weights, second.network.state_dict()[name]), name


def test_coarse_epochs_learn_as_well() -> None:
    """Mirror images and products in bfloat16 cost little of what is learned."""
    training, held = split(runs_of_a_known_plant(12, 400), 4)
    errors = []
    for coarse in (0, 4):
        trainer = Trainer(recipe(6, coarse), training, held)
        for epoch in range(6):
            trainer.run_epoch(epoch)
        errors.append(trainer.reached.best)
    assert errors[1] < 1.3 * errors[0]


def test_the_deviation_covers_ninety_percent_of_the_runs_held_out() -> None:
    training, held = split(runs_of_a_known_plant(12, 400), 4)
    trainer = Trainer(recipe(3), training, held)
    for epoch in range(3):
        trainer.run_epoch(epoch)
    network = trainer.finished()
    inside = []
    for run in held:
        with torch.no_grad():
            rows = torch.from_numpy(features(run.channels, run.commands))[:, None]
            velocity, deviation, _ = network(rows)
        error = np.abs(velocity[:, 0].numpy() - run.truth)[20:]
        inside.append(error < 1.645 * deviation[:, 0].numpy()[20:])
    assert np.concatenate(inside).mean() == pytest.approx(0.90, abs=0.01)


def test_a_checkpoint_gives_the_network_of_its_best_epoch(tmp_path: Path) -> None:
    training, held = split(runs_of_a_known_plant(8, 200), 4)
    trainer = Trainer(recipe(2), training, held)
    save(trainer, tmp_path / "c.pt")
    with pytest.raises(SensorError, match="no epoch"):
        export_checkpoint(tmp_path / "c.pt", tmp_path / "n.onnx")
    for epoch in range(2):
        trainer.run_epoch(epoch)
    save(trainer, tmp_path / "c.pt")
    export_checkpoint(tmp_path / "c.pt", tmp_path / "n.onnx")
    with torch.no_grad():
        rows = torch.from_numpy(features(held[0].channels, held[0].commands))[:, None]
        want = trainer.finished()(rows)[1][:, 0].numpy()
    got = CarriedSensor(tmp_path / "n.onnx").apply_with_deviation(
        held[0].channels, held[0].commands
    )[1]
    assert got[50:] == pytest.approx(want[50:], abs=1e-5)


def test_a_checkpoint_of_another_recipe_is_refused(tmp_path: Path) -> None:
    training, held = split(runs_of_a_known_plant(4, 200), 4)
    save(Trainer(recipe(2), training, held), tmp_path / "c.pt")
    load(Trainer(recipe(3), training, held), tmp_path / "c.pt")  # a longer training may go on
    with pytest.raises(SensorError, match="another recipe"):
        load(Trainer(recipe(2, coarse=1), training, held), tmp_path / "c.pt")  # mirrored


def test_the_network_stays_within_a_tenth_of_the_windowed_work() -> None:
    windowed = 19 * 4 * 167 * (14 + 167) + 3 * 14 * 167 + 334 * 256 + 256 * 4
    assert CarriedConfig().products <= windowed / 10
