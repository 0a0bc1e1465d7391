"""What the C sensor does between samples: bad samples, reset, copies of its state, other
instances.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest
from packed_sensor import (
    Array,
    PackedSensor,
    carried_network,
    drive,
    exported,
    windowed_network,
)

from sensor.packed import blob, read_network
from sensor.runtime import OnnxSensor

WINDOW = 7
CHANNELS, COMMANDS = drive(160)


@pytest.fixture(scope="module")
def windowed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return exported(windowed_network(WINDOW, 9, 10, True), tmp_path_factory.mktemp("windowed"))


@pytest.fixture(scope="module")
def carried(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return exported(carried_network(5, 20, 9), tmp_path_factory.mktemp("carried"))


@pytest.fixture(params=["windowed", "carried"])
def content(request: pytest.FixtureRequest) -> bytes:
    return blob(read_network(request.getfixturevalue(request.param)))


def spoilt(row: int, values: dict[int, float]) -> Array:
    channels = CHANNELS.copy()
    for channel, value in values.items():
        channels[row, channel] = value
    return channels


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300])
def test_a_bad_sample_takes_exactly_a_window_of_estimates(
    library: ctypes.CDLL, windowed: Path, value: float
) -> None:
    at = 40
    got = PackedSensor(library, blob(read_network(windowed))).run(
        spoilt(at, {3: value}), np.full((len(CHANNELS), 4), np.nan)
    )[0]
    invalid = np.isnan(got).any(axis=1)
    first = WINDOW - 1
    assert list(np.flatnonzero(invalid)) == [*range(first), *range(at, at + WINDOW)]
    sensor = OnnxSensor(windowed)
    for part in (slice(0, at), slice(at + 1, None)):
        wanted = sensor.apply(CHANNELS[part], COMMANDS[part])
        np.testing.assert_allclose(got[part], wanted, rtol=0.0, atol=1e-5)


def test_a_bad_sample_is_not_taken_into_a_carried_state(
    library: ctypes.CDLL, carried: Path
) -> None:
    bad = [0, 20, 80, 81, 82, 120]
    channels, commands = CHANNELS.copy(), COMMANDS.copy()
    channels[bad[:-1], 2] = np.nan
    commands[bad[-1], 1] = np.nan
    content = blob(read_network(carried))
    got = PackedSensor(library, content).run(channels, commands)
    rest = np.setdiff1d(np.arange(len(channels)), bad)
    wanted = PackedSensor(library, content).run(channels[rest], commands[rest])
    for mine, other in zip(got, wanted, strict=True):
        assert np.isnan(mine[bad]).all()
        np.testing.assert_array_equal(mine[rest], other)


def test_bad_channels_are_told_by_bits(library: ctypes.CDLL, content: bytes) -> None:
    sensor = PackedSensor(library, content)
    carried = read_network_kind(content) == 1
    for k in range(100):
        sensor.step(CHANNELS[k], COMMANDS[k])
        assert sensor.bad == 0
    before = sensor.estimate.copy()
    sample, command = CHANNELS[100].copy(), COMMANDS[100].copy()
    sample[[0, 13]], command[2] = (np.nan, np.inf), np.nan
    assert not sensor.step(sample, command)
    assert sensor.bad == 1 | 1 << 13 | (1 << 16 if carried else 0)
    assert np.array_equal(sensor.estimate, before)
    assert np.isfinite(before).all()


def read_network_kind(content: bytes) -> int:
    return int.from_bytes(content[24:28], "little")


def test_huge_samples_give_finite_estimates_or_none(library: ctypes.CDLL, content: bytes) -> None:
    sensor = PackedSensor(library, content)
    channels = spoilt(90, dict.fromkeys(range(14), 3e38))
    got = sensor.run(channels, COMMANDS)[0]
    counted = ~np.isnan(got).any(axis=1)
    assert counted[-20:].all()
    assert np.isfinite(sensor.estimate).all()


def test_reset_equals_a_fresh_sensor(library: ctypes.CDLL, content: bytes) -> None:
    sensor = PackedSensor(library, content)
    wanted = sensor.run(CHANNELS, COMMANDS)
    sensor.reset()
    np.testing.assert_array_equal(sensor.run(CHANNELS, COMMANDS), wanted)


@pytest.mark.parametrize("offset", [0, 8, 24, 56])
def test_the_state_is_its_bytes(library: ctypes.CDLL, content: bytes, offset: int) -> None:
    wanted = PackedSensor(library, content).run(CHANNELS, COMMANDS)
    for moved in (3, 30, 100):
        sensor = PackedSensor(library, content)
        first = sensor.run(CHANNELS[:moved], COMMANDS[:moved])
        sensor.move_state(offset)
        last = sensor.run(CHANNELS[moved:], COMMANDS[moved:])
        np.testing.assert_array_equal(np.concatenate([first, last], axis=1), wanted)


def test_instances_do_not_touch_each_other(library: ctypes.CDLL, content: bytes) -> None:
    wanted = PackedSensor(library, content).run(CHANNELS, COMMANDS)[0]
    one, other = PackedSensor(library, content), PackedSensor(library, content)
    for k in range(len(CHANNELS)):
        counts = one.step(CHANNELS[k], COMMANDS[k])
        other.step(CHANNELS[-1 - k], COMMANDS[-1 - k])
        if counts:
            np.testing.assert_array_equal(one.estimate, wanted[k])
