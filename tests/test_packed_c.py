"""The C sensor against ONNX Runtime: the shipped networks, and random ones of odd shapes."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import pytest
from packed_sensor import (
    PackedSensor,
    carried_network,
    compile_sensor,
    drive,
    exported,
    load_library,
    windowed_network,
)

from sensor.carried.runtime import CarriedSensor
from sensor.packed import blob, read_network
from sensor.runtime import OnnxSensor

MODELS = sorted((Path(__file__).parents[1] / "sensor" / "models").glob("*.onnx"))
TOLERANCE = 1e-5  # m/s
WINDOWED = [
    (3, 1, 1, False),
    (4, 7, 5, True),
    (19, 16, 64, False),
    (11, 17, 65, True),
    (51, 40, 30, False),
]
CARRIED = [(1, 1, 1), (8, 12, 6), (17, 33, 70), (64, 48, 64)]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return load_library(compile_sensor(tmp_path_factory.mktemp("sensor") / "sensor.so"))


def packed(path: Path) -> bytes:
    return blob(read_network(path))


def onnx_sensor(path: Path) -> OnnxSensor | CarriedSensor:
    return CarriedSensor(path) if read_network(path).kind == "carried" else OnnxSensor(path)


def compare(library: ctypes.CDLL, path: Path, samples: int) -> None:
    channels, commands = drive(samples)
    channels = channels.astype(np.float32).astype(np.float64)
    want = onnx_sensor(path).apply(channels, commands)
    got, deviation = PackedSensor(library, packed(path)).run(channels, commands)
    assert np.array_equal(np.isnan(got), np.isnan(want))
    assert np.isfinite(got[-1]).all()
    np.testing.assert_allclose(got, want, rtol=0.0, atol=TOLERANCE)
    sensor = onnx_sensor(path)
    if isinstance(sensor, CarriedSensor):
        wanted = sensor.apply_with_deviation(channels, commands)[1]
        np.testing.assert_allclose(deviation, wanted, rtol=0.0, atol=TOLERANCE)


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_shipped_networks_give_what_onnx_runtime_gives(library: ctypes.CDLL, path: Path) -> None:
    compare(library, path, 600)


@pytest.mark.parametrize("shape", WINDOWED, ids=str)
def test_windowed_networks_of_odd_shapes(
    library: ctypes.CDLL, tmp_path: Path, shape: tuple[int, int, int, bool]
) -> None:
    compare(library, exported(windowed_network(*shape), tmp_path), 150)


@pytest.mark.parametrize("shape", CARRIED, ids=str)
def test_carried_networks_of_odd_shapes(
    library: ctypes.CDLL, tmp_path: Path, shape: tuple[int, int, int]
) -> None:
    compare(library, exported(carried_network(*shape), tmp_path), 300)
