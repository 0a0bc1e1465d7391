"""The C sensor against ONNX Runtime: the shipped networks, and random ones of odd shapes, on every
kernel that this machine has.
"""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest
from packed_sensor import (
    Array,
    PackedSensor,
    carried_network,
    drive,
    exported,
    kernels,
    windowed_network,
)

from sensor.carried.runtime import CarriedSensor
from sensor.packed import blob, read_network
from sensor.runtime import OnnxSensor

MODELS = sorted((Path(__file__).parents[1] / "sensor" / "models").glob("*.onnx"))
TOLERANCE = 1e-5  # m/s
WINDOWED = [
    *((2, 3, 4, False), (3, 1, 1, False), (4, 7, 5, True), (8, 16, 64, False)),
    *((15, 17, 65, True), (19, 32, 12, False), (51, 40, 30, False)),
]
CARRIED = [(1, 1, 1), (8, 12, 6), (17, 33, 70), (64, 48, 64)]
ALLOWED = {  # of the C library
    *("memcpy", "memset", "cos", "sin", "expf", "logf", "sqrtf", "floorf"),
    *("fmin", "fmax", "fminf", "fmaxf"),
}


def by_onnx_runtime(path: Path, channels: Array, commands: Array) -> tuple[Array, Array]:
    if read_network(path).kind == "carried":
        return CarriedSensor(path).apply_with_deviation(channels, commands)
    want = OnnxSensor(path).apply(channels, commands)
    return want, np.where(np.isnan(want), np.nan, 0.0)


def compare(library: ctypes.CDLL, path: Path, samples: int) -> None:
    channels, commands = drive(samples)
    wanted = by_onnx_runtime(path, channels, commands)
    content = blob(read_network(path))
    for kernel in kernels(library):
        assert library.network_choose_kernel(kernel.encode())
        got = PackedSensor(library, content).run(channels, commands)
        for mine, theirs in zip(got, wanted, strict=True):
            assert np.isfinite(theirs[-1]).all()
            np.testing.assert_allclose(mine, theirs, rtol=0.0, atol=TOLERANCE, err_msg=kernel)


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_shipped_networks_give_what_onnx_runtime_gives(library: ctypes.CDLL, path: Path) -> None:
    compare(library, path, 200)


@pytest.mark.parametrize("shape", WINDOWED, ids=str)
def test_windowed_networks_of_odd_shapes(
    library: ctypes.CDLL, tmp_path: Path, shape: tuple[int, int, int, bool]
) -> None:
    compare(library, exported(windowed_network(*shape), tmp_path), 120)


@pytest.mark.parametrize("shape", CARRIED, ids=str)
def test_carried_networks_of_odd_shapes(
    library: ctypes.CDLL, tmp_path: Path, shape: tuple[int, int, int]
) -> None:
    compare(library, exported(carried_network(*shape), tmp_path), 300)


def test_of_the_c_library_it_takes_memcpy_memset_and_mathematics_only(
    library: ctypes.CDLL,
) -> None:
    command = ["nm", "--dynamic", "--undefined-only", library._name]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    taken = {line.split()[-1].split("@")[0] for line in text.splitlines() if " U " in line}
    assert "memcpy" in taken
    assert taken <= ALLOWED
