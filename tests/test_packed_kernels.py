"""The C sensor's kernels: their functions against exact ones, and against each other."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from packed_sensor import (
    PackedSensor,
    carried_network,
    drive,
    exported,
    kernels,
    windowed_network,
)

from sensor.packed import blob, read_network

FUNCTIONS = {"bend": 4, "open": 5}  # places in a Kernel
ABSOLUTE = 3.5e-7  # three units in the last place of 1
RELATIVE = 4e-7  # of tanh; the opening of a gate counts by what it lets through


def function(library: ctypes.CDLL, kernel: str, name: str, x: npt.NDArray[np.float32]) -> object:
    fields = (ctypes.c_void_p * 6).in_dll(library, f"KERNEL_{kernel.upper()}")
    call = ctypes.CFUNCTYPE(None, ctypes.c_size_t, ctypes.c_void_p)(fields[FUNCTIONS[name]])
    values = x.copy()
    call(len(values), values.ctypes.data)
    return values


def everywhere() -> npt.NDArray[np.float32]:
    """Return numbers of all magnitudes and both signs, and a fine grid where the functions bend."""
    tiny = np.logspace(-44, 38, 40_000)
    grid = np.linspace(-20.0, 20.0, 200_000)
    special = [0.0, -0.0, np.inf, -np.inf, 9.02, -9.02, 18.04, -18.04]
    x = np.concatenate([special, tiny, -tiny, grid]).astype(np.float32)
    return np.resize(x, len(x) // 16 * 16)


def test_every_kernel_of_this_machine_is_tested(library: ctypes.CDLL) -> None:
    assert kernels(library)[-1] == "portable"
    assert library.network_kernel().decode() == kernels(library)[0]
    assert not library.network_choose_kernel(b"abacus")


def test_tanh_over_the_whole_range(library: ctypes.CDLL) -> None:
    x = everywhere()
    exact = np.tanh(x.astype(np.float64))
    for kernel in kernels(library):
        error = np.abs(function(library, kernel, "bend", x) - exact)
        assert error.max() <= ABSOLUTE, kernel
        normal = np.abs(x) > 1e-37
        assert (error[normal] <= RELATIVE * np.abs(exact[normal])).all(), kernel


def test_the_opening_of_a_gate_over_the_whole_range(library: ctypes.CDLL) -> None:
    x = everywhere()
    with np.errstate(over="ignore"):
        exact = 1.0 / (1.0 + np.exp(-x.astype(np.float64)))
    for kernel in kernels(library):
        error = np.abs(function(library, kernel, "open", x) - exact)
        assert error.max() <= ABSOLUTE, kernel


def test_a_nan_stays_one(library: ctypes.CDLL) -> None:
    x = np.full(16, np.nan, dtype=np.float32)
    for kernel in kernels(library):
        for name in FUNCTIONS:
            assert np.isnan(function(library, kernel, name, x)).all()


@pytest.mark.parametrize("units", [45, 39, 48])  # of the last 16: 13, 7, which end within 8, all
@pytest.mark.parametrize("kind", ["windowed", "carried"])
def test_kernels_differ_by_rounding_only_and_repeat_their_bits(
    library: ctypes.CDLL, tmp_path: Path, kind: str, units: int
) -> None:
    windowed = windowed_network(19, units, 33, True)
    network = windowed if kind == "windowed" else carried_network(20, units, 33)
    content = blob(read_network(exported(network, tmp_path)))
    channels, commands = drive(150)
    results = {}
    for kernel in (*kernels(library), *kernels(library)):
        assert library.network_choose_kernel(kernel.encode())
        estimates = PackedSensor(library, content).run(channels, commands)[0]
        np.testing.assert_array_equal(estimates, results.setdefault(kernel, estimates))
    plain = results["portable"]
    for kernel, estimates in results.items():
        np.testing.assert_allclose(estimates, plain, rtol=0.0, atol=3e-6, err_msg=kernel)
