"""Write the trained network as ONNX: (batch, W, 14) in SI units -> (batch, 4) in m/s, normalisation
inside the graph.

The graph is built node by node: a dozen nodes, every name chosen, no exporter in between. The
forward direction is one LSTM operator over the window; the backward direction is its one step on
the last sample, exact for the last-sample tap (see `sensor.network`). A network is written only
after ONNX Runtime has reproduced torch's output to 1e-5 m/s, sample by sample in the streaming form
(`sensor.streaming`) too, which the run time makes of the file when it opens it.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import onnx
import onnxruntime as ort
import torch
from onnx import TensorProto, helper, numpy_helper

from sensor.channels import CHANNEL_NAMES, CHANNEL_UNITS, OUTPUT_NAMES, OUTPUT_UNITS, SAMPLE_RATE_HZ
from sensor.errors import SensorError
from sensor.features import WHEEL_SPEEDS
from sensor.metadata import METADATA_KEY
from sensor.network import TAP, BiLstmNetwork
from sensor.operation import IR_VERSION, OPSET, Operation
from sensor.residual_matrices import (
    ResidualMatrices,
    residual_constants,
    residual_operations,
)
from sensor.streaming.export import verified

TOLERANCE = 1e-5
RAW = "the channels as they are"
RESIDUAL = (
    "the graph takes from the wheel speeds what driving explains before it standardises; mean and "
    "deviation at their places are those of these residuals"
)
_TORCH_TO_ONNX_GATES = [0, 3, 1, 2]  # input, forget, cell, output -> input, output, forget, cell

Float32 = npt.NDArray[np.float32]


def export_windowed(
    network: BiLstmNetwork, path: str | Path, training: dict[str, Any] | None = None
) -> Path:
    """Write `network` to `path` with its metadata and the `training` record; return the path.

    Raises SensorError, and writes nothing, if ONNX Runtime and torch, or the network's streaming
    form and the file, differ by more than 1e-5 m/s.
    """
    model = build_windowed(network, training)
    verify(model, network)
    path = Path(path)
    temporary = path.with_suffix(".part")
    onnx.save(model, str(temporary))
    try:
        verified(temporary)
    except SensorError:
        temporary.unlink()
        raise
    temporary.replace(path)
    return path


def build_windowed(
    network: BiLstmNetwork, training: dict[str, Any] | None = None
) -> onnx.ModelProto:
    """Build the windowed graph with explicit normalisation nodes and metadata."""
    config = network.config
    nodes = [
        *([node_of(o) for o in residual_operations()] if config.residual else []),
        helper.make_node(
            "Sub", ["seen" if config.residual else "measured", "input_mean"], ["centred"]
        ),
        helper.make_node("Div", ["centred", "input_std"], ["standardised"]),
        helper.make_node("Transpose", ["standardised"], ["time_major"], perm=[1, 0, 2]),
        helper.make_node(
            "LSTM",
            ["time_major", "forward_W", "forward_R", "forward_B"],
            ["", "forward_state"],  # the last hidden state only: (1, batch, units)
            hidden_size=config.units,
        ),
        helper.make_node("Squeeze", ["forward_state", "first_axis"], ["forward_last"]),
        helper.make_node("Gather", ["standardised", "last"], ["last_sample"], axis=1),
        helper.make_node(
            "Gemm", ["last_sample", "backward_W", "backward_B"], ["backward_gates"], transB=1
        ),
        helper.make_node("Split", ["backward_gates"], ["gate_in", "candidate", "gate_out"], axis=1),
        *_cell(),
        helper.make_node("Concat", ["forward_last", "backward_last"], ["features"], axis=1),
        helper.make_node("Gemm", ["features", "dense_W", "dense_B"], ["dense"], transB=1),
        helper.make_node("Relu", ["dense"], ["rectified"]),
        helper.make_node("Gemm", ["rectified", "output_W", "output_B"], ["velocity"], transB=1),
        helper.make_node("Mul", ["velocity", "output_std"], ["scaled"]),
        helper.make_node("Add", ["scaled", "output_mean"], ["estimate"]),
    ]
    measured = helper.make_tensor_value_info(
        "measured", TensorProto.FLOAT, ["batch", config.window, config.channels]
    )
    estimate = helper.make_tensor_value_info(
        "estimate", TensorProto.FLOAT, ["batch", config.outputs]
    )
    graph = helper.make_graph(
        nodes, "suspension_velocity_sensor", [measured], [estimate], _weights(network)
    )
    model = helper.make_model(
        graph,
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="sensor",
    )
    helper.set_model_props(
        model, {METADATA_KEY: json.dumps(metadata(network, training), sort_keys=True)}
    )
    onnx.checker.check_model(model, full_check=True)
    return model


def node_of(operation: Operation) -> onnx.NodeProto:
    """Return the ONNX node of an operation."""
    return helper.make_node(
        operation.kind, operation.inputs, operation.outputs, **operation.attributes
    )


def _cell() -> list[onnx.NodeProto]:
    """One LSTM cell from zero state: output gate * tanh(input gate * tanh(candidate))."""
    return [
        helper.make_node("Sigmoid", ["gate_in"], ["gate_in_open"]),
        helper.make_node("Tanh", ["candidate"], ["candidate_bounded"]),
        helper.make_node("Mul", ["gate_in_open", "candidate_bounded"], ["cell"]),
        helper.make_node("Tanh", ["cell"], ["cell_bounded"]),
        helper.make_node("Sigmoid", ["gate_out"], ["gate_out_open"]),
        helper.make_node("Mul", ["gate_out_open", "cell_bounded"], ["backward_last"]),
    ]


def _weights(network: BiLstmNetwork) -> list[onnx.TensorProto]:
    state = {name: value.detach().numpy() for name, value in network.state_dict().items()}
    units = network.config.units
    arrays: dict[str, npt.NDArray[Any]] = {
        "forward_W": _onnx_gates(state["forward_lstm.weight_ih_l0"], units)[np.newaxis],
        "forward_R": _onnx_gates(state["forward_lstm.weight_hh_l0"], units)[np.newaxis],
        "forward_B": np.concatenate(
            [_onnx_gates(state[f"forward_lstm.bias_{part}_l0"], units) for part in ("ih", "hh")]
        )[np.newaxis],
        "backward_W": state["backward_cell.weight"],
        "backward_B": state["backward_cell.bias"],
        "dense_W": state["dense.weight"],
        "dense_B": state["dense.bias"],
        "output_W": state["output.weight"],
        "output_B": state["output.bias"],
        "first_axis": np.array([0], dtype=np.int64),
        "last": np.array(network.config.window - 1, dtype=np.int64),
    }
    arrays |= {
        name: state[name] for name in ("input_mean", "input_std", "output_mean", "output_std")
    }
    if network.config.residual:
        arrays |= residual_constants()
    return [
        numpy_helper.from_array(np.asarray(array, order="C"), name)
        for name, array in arrays.items()
    ]


def _onnx_gates(rows: Float32, units: int) -> Float32:
    """Reorder the four blocks of `units` rows from torch's gate order to that of ONNX."""
    return rows.reshape(4, units, -1)[_TORCH_TO_ONNX_GATES].reshape(rows.shape)


def metadata(network: BiLstmNetwork, training: dict[str, Any] | None = None) -> dict[str, Any]:
    """Return what the file says of itself: channels, units, normalisation, rate, window, tap,
    training record.
    """
    return {
        "window": network.config.window,
        "sample_rate_hz": SAMPLE_RATE_HZ,
        "inputs": {
            "names": list(CHANNEL_NAMES),
            "units": list(CHANNEL_UNITS),
            "mean": network.input_mean.tolist(),
            "std": network.input_std.tolist(),
        },
        "outputs": {
            "names": list(OUTPUT_NAMES),
            "units": list(OUTPUT_UNITS),
            "mean": network.output_mean.tolist(),
            "std": network.output_std.tolist(),
        },
        "features": RESIDUAL if network.config.residual else RAW,
        "network": {"units": network.config.units, "hidden": network.config.hidden},
        "tap": TAP,
        "training": training or {},
    }


def verify(model: onnx.ModelProto, network: BiLstmNetwork, windows: int = 64) -> float:
    """Compare ONNX Runtime with torch on random windows of the training data's spread; return the
    largest difference [m/s].

    Raises SensorError if it exceeds 1e-5 m/s.
    """
    measured = _random_windows(network, windows)
    was_training = network.training
    network.eval()
    with torch.no_grad():
        expected = network(torch.from_numpy(measured)).numpy()
    network.train(was_training)
    session = ort.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    difference = float(
        np.max(np.abs(np.asarray(session.run(None, {"measured": measured})[0]) - expected))
    )
    if not difference <= TOLERANCE:
        raise SensorError(
            f"not written: ONNX Runtime is {difference:.3g} m/s off torch (limit {TOLERANCE:g})."
        )
    return difference


def _random_windows(network: BiLstmNetwork, count: int) -> Float32:
    """Draw windows (count, W, 14) of the training data's spread, in SI units."""
    config = network.config
    noise = np.random.default_rng(0).normal(size=(count, config.window, config.channels))
    measured = noise * network.input_std.numpy() + network.input_mean.numpy()
    if config.residual:  # mean and deviation there are those of residuals
        measured[..., WHEEL_SPEEDS] += ResidualMatrices.of().driven(measured)
    return np.asarray(measured, dtype=np.float32)
