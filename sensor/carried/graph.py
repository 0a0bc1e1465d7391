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

from sensor.body_motion import Geometry
from sensor.carried.features import (
    DELAYED,
    INTEGRALS,
    LINE,
    MEANS,
    STEER,
    FeatureConfig,
    features,
    scales,
)
from sensor.carried.network import SCALE, CarriedNetwork
from sensor.carried.nodes import nodes
from sensor.carried.runtime import STATES, CarriedSensor
from sensor.channels import (
    CHANNEL_NAMES,
    CHANNEL_UNITS,
    OUTPUT_NAMES,
    OUTPUT_UNITS,
    SAMPLE_RATE_HZ,
)
from sensor.errors import SensorError
from sensor.export import IR_VERSION, OPSET
from sensor.features import WHEEL_SPEEDS, Slip
from sensor.runtime import CARRIED, METADATA_KEY

TOLERANCE = 1e-5  # m/s
_TORCH_TO_ONNX_GATES = [0, 3, 1, 2]  # input, forget, cell, output -> input, output, forget, cell

Arrays = dict[str, npt.NDArray[Any]]


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
    arrays = {**_feature_constants(c), **_weights(network)}
    graph = helper.make_graph(
        nodes(units),
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
    channels[:, [5, *STEER]] *= 0.1
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


def _feature_constants(c: FeatureConfig) -> Arrays:
    g, s = Geometry(), Slip()
    y = np.array([g.left_y, g.right_y, g.left_y, g.right_y])
    h = 1.0 / SAMPLE_RATE_HZ
    slow = [c.slip_time] * 4 + [c.bias_time] * 3 + [c.level_time]
    settling = [c.settling[0]] * 4 + [c.settling[1]] * 3 + [0.25 * c.level_time]
    reals = {
        "one": [[1.0]], "half": 0.5,
        "residual_least": -s.limit, "residual_most": s.limit,
        "slip_least": -c.slip_limit, "slip_most": c.slip_limit, "least_speed": c.least_speed,
        "slowest_rates": [[h / time for time in slow]],
        "zeros_before": [[time / h for time in settling]],
        "typical": c.typical, "least_energy": c.least_level**2,
        "moving_scales": scales(c), "moving_least": -c.largest, "moving_most": c.largest,
        "integral_keep": 1.0 - h / np.array([c.heave_time, c.angle_time, c.angle_time]),
        "sample_time": h, "wheelbase_samples": c.wheelbase * SAMPLE_RATE_HZ,
        "leads": np.array([c.leads]), "age_least": 0.0, "age_most": c.depth - 3.0,
        "two": 2.0, "minus_six": -6.0,
        "speed_unit": 30.0, "slowness_unit": 10.0,
    }  # fmt: skip
    doubles = {
        "wheel_y": y, "ones_64": [[1.0, 1.0]], "one_64": 1.0, "two_64": 2.0,
        "per_ax": s.per_ax, "per_ay": -s.per_ay * np.sign(y),
        "axle": 1.0 + np.array([s.front, s.front, s.rear, s.rear]),
    }  # fmt: skip
    wholes = {
        "i_ax": [0], "i_ay": [1], "i_free": [2, 3, 4], "i_yaw": [5], "i_vx": [6],
        "i_road_wheels": [7, 8], "i_wheel_speeds": WHEEL_SPEEDS, "i_steer": STEER,
        "i_delayed": DELAYED, "first_row": [0], "second_row": [1],
        "mean_split": [4, 3], "rate_split": [7, 1], "line_first": [0], "line_last": [c.depth - 1],
        "column": [-1, 1], "flat": [-1], "row": [1, -1], "first_axis": [0],
        "no_row": [0], "one_row": [1], "two_rows": [2],
    }  # fmt: skip
    return {
        **{name: np.asarray(value, dtype=np.float32) for name, value in reals.items()},
        **{name: np.asarray(value, dtype=np.float64) for name, value in doubles.items()},
        **{name: np.asarray(value, dtype=np.int64) for name, value in wholes.items()},
    }


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
