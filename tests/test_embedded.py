"""The C sensor on a bare Cortex-M7 that QEMU emulates, against ONNX Runtime."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import fmu_face  # noqa: F401  puts fmu/ on the path
import numpy as np
import pytest
from packed_sensor import carried_network, drive, exported, windowed_network

from sensor.carried.runtime import CarriedSensor
from sensor.packed import read_network
from sensor.runtime import OnnxSensor

firmware = import_module("firmware")
pytestmark = pytest.mark.skipif(bool(firmware.missing()), reason=firmware.missing() or "none")

TOLERANCE = 1e-5  # m/s
NO_PLACE_HERE = ("malloc", "free", "_sbrk", "printf", "_impure_ptr", "exit", "fopen")


@pytest.mark.parametrize("kind", ["windowed", "carried"])
def test_the_board_gives_what_onnx_runtime_gives(tmp_path: Path, kind: str) -> None:
    windowed = kind == "windowed"
    network = windowed_network(7, 18, 20, True) if windowed else carried_network(10, 24, 12)
    path = exported(network, tmp_path)
    channels, commands = drive(70)
    built = firmware.build(read_network(path), np.hstack([channels, commands]), tmp_path / "built")
    answers = firmware.run(built)
    if windowed:
        wanted, spread = OnnxSensor(path).apply(channels, commands), np.zeros((70, 4))
    else:
        wanted, spread = CarriedSensor(path).apply_with_deviation(channels, commands)
    np.testing.assert_array_equal(answers.counts, ~np.isnan(wanted).any(axis=1))
    counted = answers.counts
    np.testing.assert_allclose(answers.estimates[counted], wanted[counted], rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(answers.deviations[counted], spread[counted], rtol=0, atol=TOLERANCE)
    assert 10_000 < answers.instructions[-1] < 300_000
    assert 0 < answers.stack < firmware.STACK
    assert not set(NO_PLACE_HERE) & set(firmware.symbols(built))
    assert built.memory < built.state + built.scratch + 512
