"""Write the network with carried state as ONNX: one sample in, one estimate out, its whole state
between the two explicit.

Inputs `measured` (1, 14) and `command` (1, 4) in SI units and the state; outputs `estimate` and
`deviation` (1, 4) [m/s] and the next state. A state of zeros is a fresh start. Features are part of
the graph, so any runtime of ONNX needs nothing else. The state:

| name | shape | what |
|---|---|---|
| samples | (1, 1) | number of samples so far |
| means | (1, 7) | slow means of relative residuals (4), a_z, roll rate, pitch rate |
| energy | (1, 1) | slow mean square of the motion |
| integrals | (1, 3) | heave velocity, roll angle, pitch angle |
| line | (depth, 10) | newest first: residuals (4), a_z, roll and pitch rate, a_x, a_y, yaw rate |
| hidden, cell | (1, 1, units) | the LSTM's |
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import onnx
from onnx import TensorProto, helper, numpy_helper

from sensor.carried.features import INTEGRALS, LINE, MEANS, PITCH, ROLL, STEER, YAW, features
from sensor.carried.network import SCALE, CarriedNetwork
from sensor.carried.operations import Arrays, feature_constants, operations
from sensor.carried.runtime import STATES, CarriedSensor
from sensor.channels import (
    CHANNEL_NAMES,
    CHANNEL_UNITS,
    OUTPUT_NAMES,
    OUTPUT_UNITS,
    SAMPLE_RATE_HZ,
)
from sensor.errors import SensorError
from sensor.export import node_of
from sensor.features import WHEEL_SPEEDS
from sensor.metadata import CARRIED, METADATA_KEY
from sensor.operation import IR_VERSION, OPSET

TOLERANCE = 1e-5  # m/s
_TORCH_TO_ONNX_GATES = [0, 3, 1, 2]  # input, forget, cell, output -> input, output, forget, cell


def export_carried(
    network: CarriedNetwork, path: str | Path, training: Mapping[str, Any] | None = None
) -> Path:
    """Write `network` to `path` with its metadata; return the path.

    Raises SensorError, and leaves no file, if ONNX Runtime and torch differ by more than 1e-5 m/s.
    """
    path = Path(path)
    temporary = path.with_suffix(".part")
    onnx.save(build(network, training or {}), str(temporary))
    try:
        verify(temporary, network)
    except SensorError:
        temporary.unlink()
        raise
    temporary.replace(path)
    return path


def build(network: CarriedNetwork, training: Mapping[str, Any]) -> onnx.ModelProto:
    """Build the streaming graph with features, normalisation and metadata."""
    c, units = network.config.features, network.config.units
    shapes = {
        "samples": [1, 1], "energy": [1, 1], "means": [1, MEANS], "integrals": [1, INTEGRALS],
        "line": [c.depth, LINE], "hidden": [1, 1, units], "cell": [1, 1, units],
    }  # fmt: skip

    def value(name: str, shape: list[int]) -> onnx.ValueInfoProto:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)

    inputs = [value("measured", [1, 14]), value("command", [1, 4])]
    inputs += [value(name, shapes[name]) for name in STATES]
    outputs = [value("estimate", [1, 4]), value("deviation", [1, 4])]
    outputs += [value(f"next_{name}", shapes[name]) for name in STATES]
    arrays = {**feature_constants(c), **_weights(network)}
    nodes = [node_of(operation) for operation in operations(units)]
    graph = helper.make_graph(
        nodes,
        "suspension_velocity_sensor",
        inputs,
        outputs,
        [numpy_helper.from_array(np.asarray(a, order="C"), name) for name, a in arrays.items()],
    )
    model = helper.make_model(
        graph,
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="sensor",
    )
    text = json.dumps(metadata(network, training), sort_keys=True)
    helper.set_model_props(model, {METADATA_KEY: text})
    onnx.checker.check_model(model, full_check=True)
    return model


def metadata(network: CarriedNetwork, training: Mapping[str, Any]) -> dict[str, Any]:
    """What the file says of itself."""
    config = network.config
    return {
        "kind": CARRIED,
        "sample_rate_hz": SAMPLE_RATE_HZ,
        "inputs": {"names": CHANNEL_NAMES, "units": CHANNEL_UNITS},
        "outputs": {"names": OUTPUT_NAMES, "units": OUTPUT_UNITS},
        "features": config.features.names,
        "units": config.units,
        "products_per_sample": config.products,
        "training": dict(training),
    }


def verify(path: Path, network: CarriedNetwork, samples: int = 400) -> None:
    """Raise SensorError unless ONNX Runtime streams what torch computes of a whole random run."""
    import torch

    random = np.random.default_rng(1)
    channels = random.normal(scale=0.3, size=(samples, 14))
    speed = np.linspace(1.0, 35.0, samples)
    channels[:, CHANNEL_NAMES.index("Car.vx")] = speed
    channels[:, WHEEL_SPEEDS] = speed[:, np.newaxis] + random.normal(scale=0.02, size=(samples, 4))
    channels[:, [ROLL, PITCH, YAW, *STEER]] *= 0.1  # the size that a rough road gives them
    channels = channels.astype(np.float32).astype(np.float64)  # what the graph is given
    commands = random.uniform(size=(samples, 4))
    sensor = CarriedSensor(path)
    got, deviation = sensor.apply_with_deviation(channels, commands)
    with torch.no_grad():
        rows = torch.from_numpy(features(channels, commands, network.config.features))
        wanted, spread, _ = network(rows[:, None])
    first = sensor.warm_up
    for a, b in ((got, wanted), (deviation, spread)):
        error = float(np.abs(a - b[:, 0].numpy())[first:].max())
        if not error <= TOLERANCE:
            raise SensorError(f"{path}: ONNX Runtime and torch differ by {error:.2g} m/s.")


def _weights(network: CarriedNetwork) -> Arrays:
    w = {name: value.detach().numpy() for name, value in network.state_dict().items()}
    units = network.config.units

    def gates(rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
        blocks = rows.reshape(4, units, *rows.shape[1:])
        return np.asarray(blocks[_TORCH_TO_ONNX_GATES].reshape(rows.shape))

    bias = [gates(w[f"lstm.bias_{part}_l0"]) for part in ("ih", "hh")]
    dense = ("front", "hidden", "output")
    return {
        **{f"{name}_W": w[f"{name}.weight"] for name in dense},
        **{f"{name}_B": w[f"{name}.bias"] for name in dense},
        "deviation_W": w["log_deviation.weight"], "deviation_B": w["log_deviation.bias"],
        "straight_W": w["straight.weight"],
        "lstm_W": gates(w["lstm.weight_ih_l0"])[np.newaxis],
        "lstm_R": gates(w["lstm.weight_hh_l0"])[np.newaxis],
        "lstm_B": np.concatenate(bias)[np.newaxis],
        "mean": w["mean"], "std": w["std"], "scale": np.float32(SCALE),
        "deviation_least": np.float32(-6.0), "deviation_most": np.float32(3.0),
        "deviation_scale": np.float32(SCALE) * w["calibration"],
    }  # fmt: skip
