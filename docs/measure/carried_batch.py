"""The network with carried state on many runs at once: features for whole runs, and its LSTM over a
batch of them, a hundred times as fast as sample by sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import onnx
import torch
from onnx import numpy_helper

from sensor.carried.features import features
from sensor.carried.network import SCALE, CarriedConfig, CarriedNetwork
from sensor.carried.runtime import WARM_UP, CarriedSensor
from sensor.channels import CHANNEL_NAMES
from sensor.errors import SensorError
from sensor.estimators import model_file
from sensor.features import WHEEL_SPEEDS

Array = npt.NDArray[np.float64]
_GATES = (0, 2, 3, 1)  # ONNX: input, output, forget, cell; torch: input, forget, cell, output
_TOLERANCE = 1e-4  # m/s


def estimates(
    condition: str, runs: Sequence[tuple[Array, Array]]
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return velocities and deviations (runs, samples, 4) [m/s] of runs of one length, each given
    by its channels (samples, 14) and commands (samples, 4); NaN where `CarriedSensor` has none.
    """
    network = read(condition)
    rows = np.stack([features(*run) for run in runs], axis=1)
    with torch.no_grad():
        velocity, deviation, _ = network(torch.from_numpy(rows))
    found = [np.swapaxes(part.numpy(), 0, 1).copy() for part in (velocity, deviation)]
    for part in found:
        part[:, :WARM_UP] = np.nan
    return found[0], found[1]


@cache
def read(condition: str) -> CarriedNetwork:
    """Return the shipped network of a condition; raises SensorError if its file does not give the
    same estimates as this.
    """
    file = model_file("carried", condition)  # type: ignore[arg-type]
    assert file is not None
    initial = {a.name: numpy_helper.to_array(a) for a in onnx.load(file).graph.initializer}
    w = {name: torch.from_numpy(np.array(array)) for name, array in initial.items()}
    units = w["lstm_R"].shape[2]
    config = CarriedConfig(len(w["front_B"]), units, len(w["hidden_B"]))
    network = CarriedNetwork(config).eval()

    def gates(rows: torch.Tensor) -> torch.Tensor:
        return rows.reshape(4, units, *rows.shape[1:])[list(_GATES)].reshape(rows.shape)

    bias = w["lstm_B"][0]
    network.load_state_dict(
        {
            **{f"{a}.weight": w[f"{a}_W"] for a in ("front", "hidden", "output", "straight")},
            **{f"{a}.bias": w[f"{a}_B"] for a in ("front", "hidden", "output")},
            "log_deviation.weight": w["deviation_W"], "log_deviation.bias": w["deviation_B"],
            "lstm.weight_ih_l0": gates(w["lstm_W"][0]), "lstm.weight_hh_l0": gates(w["lstm_R"][0]),
            "lstm.bias_ih_l0": gates(bias[: 4 * units]),
            "lstm.bias_hh_l0": gates(bias[4 * units :]),
            "mean": w["mean"], "std": w["std"], "calibration": w["deviation_scale"] / SCALE,
        }
    )  # fmt: skip
    _check(file, network)
    return network


def _check(file: Path, network: CarriedNetwork) -> None:
    """Raise SensorError unless the file streams what the network computes of a random drive."""
    random = np.random.default_rng(1)
    channels = random.normal(scale=0.02, size=(WARM_UP + 100, len(CHANNEL_NAMES)))
    channels[:, [CHANNEL_NAMES.index("Car.vx"), *WHEEL_SPEEDS]] += 15.0
    commands = np.full((len(channels), 4), 0.3)
    streamed = CarriedSensor(file).apply(channels, commands)[WARM_UP:]
    with torch.no_grad():
        whole = network(torch.from_numpy(features(channels, commands))[:, None])[0]
    error = float(np.abs(whole[WARM_UP:, 0].numpy() - streamed).max())
    if not error <= _TOLERANCE:
        raise SensorError(
            f"{file}: its estimates differ by {error:.2g} m/s from what the features here give."
        )
