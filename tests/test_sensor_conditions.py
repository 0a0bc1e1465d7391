"""Measurement conditions against what their figures promise: spectra, steps, offsets, latency."""

import tracemalloc

import numpy as np
import numpy.typing as npt
import pytest

from sensor.channels import CHANNEL_NAMES, STAGED
from sensor.conditions import CONDITIONS, PRODUCTION, PRODUCTION_PARAMETERS, Measurement
from sensor.errors import SensorError

Array = npt.NDArray[np.float64]
SAMPLES = 20_000


def signals(samples: int = SAMPLES, level: float = 0.0) -> tuple[Array, Array]:
    """Constant channels and stage."""
    return np.full((samples, 14), level), np.full((samples, 11), level)


def varied(samples: int, seed: int = 0) -> tuple[Array, Array]:
    """Channels and stage that change at every sample."""
    random = np.random.default_rng(seed)
    return random.normal(size=(samples, 14)) + 3.0, random.normal(size=(samples, 11)) - 2.0


def test_ideal_leaves_the_channels_untouched() -> None:
    channels, stage = varied(50)
    measurement = Measurement("ideal", 1)
    np.testing.assert_array_equal(measurement.apply(channels, stage), channels)
    assert measurement.step(channels[0], stage[0]) is not None
    np.testing.assert_array_equal(measurement.step(channels[0], stage[0]), channels[0])


@pytest.mark.parametrize("condition", CONDITIONS)
def test_sample_by_sample_gives_the_same_bits_as_a_run_at_once(condition: str) -> None:
    channels, stage = varied(300)
    measurement = Measurement(condition, 7)
    expected = measurement.apply(channels, stage)
    for _ in range(2):
        streamed = [measurement.step(c, s).copy() for c, s in zip(channels, stage, strict=True)]
        np.testing.assert_array_equal(streamed, expected)
        measurement.reset()


def test_the_seed_decides_every_bit() -> None:
    channels, stage = varied(100)
    one, same, other = (
        Measurement("production", seed).apply(channels, stage) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, same)
    assert (one != other).any(axis=0).all()


def test_noise_is_white_and_as_large_as_promised() -> None:
    """Against the channel's own mean; steps add their twelfth of a square to the variance."""
    measured = Measurement("production", 3).apply(*signals())
    for i, promised in enumerate(PRODUCTION):
        error = measured[:, i] - measured[:, i].mean()
        expected = np.hypot(promised.noise, promised.step / np.sqrt(12.0))
        assert error.std() == pytest.approx(expected, rel=0.05), CHANNEL_NAMES[i]
        power = np.abs(np.fft.rfft(error)[1:]) ** 2
        bands = [part.mean() for part in np.array_split(power, 5)]
        np.testing.assert_allclose(bands, np.mean(bands), rtol=0.15)


def test_noise_of_two_channels_is_unrelated() -> None:
    correlation = np.corrcoef(Measurement("production", 3).apply(*signals()).T)
    assert np.abs(correlation - np.eye(14)).max() < 5.0 / np.sqrt(SAMPLES)


def test_values_are_whole_steps() -> None:
    measured = Measurement("production", 4).apply(*varied(500))
    for i, promised in enumerate(PRODUCTION):
        steps = measured[:, i] / promised.step
        np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
        differences = np.diff(np.unique(measured[:, i]))
        assert differences.min() == pytest.approx(promised.step, rel=1e-6)


def test_offset_and_gain_are_constant_in_a_run_and_spread_over_runs() -> None:
    measurement = Measurement("production", 5)
    for level in (0.0, 20.0):
        measured = measurement.apply(*signals(level=level))
        for half in np.split(measured, 2):
            expected = measurement.gain * level + measurement.bias
            tolerance = (
                5.0
                * np.hypot([p.noise for p in PRODUCTION], [p.step for p in PRODUCTION])
                / np.sqrt(len(half))
            )
            assert (np.abs(half.mean(axis=0) - expected) < tolerance).all()
    drawn = [Measurement("production", seed) for seed in range(400)]
    bias, gain = np.std([m.bias for m in drawn], axis=0), np.std([m.gain for m in drawn], axis=0)
    np.testing.assert_allclose(bias, [p.bias for p in PRODUCTION], rtol=0.15)
    own = [i for i, name in enumerate(CHANNEL_NAMES) if name != "Car.vx"]
    np.testing.assert_allclose(gain[own], [PRODUCTION[i].scale for i in own], rtol=0.15)


def test_the_speed_shares_the_gain_of_the_wheels() -> None:
    gain = Measurement("production", 6).gain
    assert gain[CHANNEL_NAMES.index("Car.vx")] == pytest.approx(gain[9:13].mean())
    assert np.unique(gain[9:13]).size == 4


def test_a_jump_arrives_after_the_latency() -> None:
    channels, stage = signals(40)
    channels[20:], stage[20:] = 100.0, 100.0
    measured = Measurement("production", 7).apply(channels, stage)
    for i, promised in enumerate(PRODUCTION):
        assert int(np.argmax(measured[:, i] > 50.0)) == 20 + promised.latency


def test_the_stage_replaces_all_but_the_steering_angles() -> None:
    channels, stage = np.full((500, 14), 1e3), np.full((500, 11), -1e3)
    level = np.sign(Measurement("production", 8).apply(channels, stage).mean(axis=0))
    np.testing.assert_array_equal(level, [-1 if i in STAGED else 1 for i in range(14)])


def test_no_condition_is_milder_than_the_prototype() -> None:
    least = {"Car.az": 0.03, "Car.RollVel": np.radians(0.1), "Car.vx": 0.02, "Car.vFL": 0.01,
             "Steer.WhlAng": np.radians(0.1)}  # fmt: skip
    for name, noise in least.items():
        assert PRODUCTION[CHANNEL_NAMES.index(name)].noise >= noise
    assert PRODUCTION[CHANNEL_NAMES.index("Car.vRR")].step >= 1.0 / 128.0
    assert PRODUCTION[CHANNEL_NAMES.index("Steer.WhlAng")].step >= np.radians(0.1)
    assert PRODUCTION_PARAMETERS["Sensor.WheelSpd.Teeth"] == 48.0


def test_a_step_allocates_nothing() -> None:
    channels, stage = varied(2)
    measurement = Measurement("production", 1)
    measurement.step(channels[0], stage[0])
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(200):
        measurement.step(channels[1], stage[1])
    now, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert now - before < 256
    assert peak - before < 1024


def test_an_unknown_condition_is_named() -> None:
    with pytest.raises(SensorError, match="'prodution'; it is ideal or production"):
        Measurement("prodution", 1)
