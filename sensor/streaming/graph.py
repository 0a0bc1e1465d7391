"""The streaming form of a windowed network as an ONNX graph with explicit state.

A window of W samples that ends now began W - 1 samples ago. So W windows are in flight at any time,
one for each sample at which one began, and a sample advances all of them by one step of the forward
LSTM: one product (W - 1, units) x (units, 4 units) where the windowed form makes W - 1 dependent
products of one row. The result is the windowed network's to round-off.

Rows of a state after a sample: row j is the window that began j samples ago, row W - 1 is complete,
and row W is the backward direction's one cell, whose output the dense layers read beside row W - 1.
Inputs and outputs, float32:

| name | shape | what |
|---|---|---|
| measured | (1, 14) | the sample, SI units |
| hidden | (W - 1, units) | rows 0 to W - 2 of the last next_hidden |
| cell | (W + 1, units) | a row of zeros, rows 0 to W - 2 of the last next_cell, a row of zeros |
| estimate | (1, 4) | m/s; counts from the W-th sample on |
| next_hidden, next_cell | (W + 1, units) | all rows after this sample |

States of zeros are a fresh start. Row 0, the window that begins, takes its first gates from the
sample alone: nothing is multiplied by a zero, so that a NaN in a sample is in exactly the W outputs
whose windows hold the sample.

Whoever runs the graph need not copy any row: `hidden` is the front part of next_hidden where that
lies, and next_cell written one row behind the start of a buffer leaves `cell` in its place, with
only its last row to be set to zero again.
"""

import json
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNELS, OUTPUTS
from sensor.errors import SensorError
from sensor.metadata import METADATA_KEY
from sensor.operation import Operation, operation
from sensor.packed.network import PackedNetwork
from sensor.residual_matrices import residual_operations
from sensor.streaming.onnx_writer import Graph, written

Arrays = dict[str, npt.NDArray[Any]]

STREAMING: Final = "streaming"
"""What the metadata of such a file say of its form."""


def streaming_model(network: PackedNetwork) -> bytes:
    """Return the streaming form of a windowed network as an ONNX file.

    Raises SensorError for a network with carried state, which streams already.
    """
    if network.kind != "windowed":
        raise SensorError("only a windowed network has a streaming form of its own.")
    rows, units = network.window + 1, network.units
    graph = Graph(
        operations=(*(residual_operations() if network.residual else []), *_operations(network)),
        constants={**network.arrays, **_constants(network)},
        inputs={
            "measured": (1, len(CHANNELS)), "hidden": (rows - 2, units), "cell": (rows, units)
        },
        outputs={
            "estimate": (1, len(OUTPUTS)), "next_hidden": (rows, units), "next_cell": (rows, units)
        },
    )  # fmt: skip
    metadata = {**network.metadata, "form": STREAMING}
    return written(
        graph,
        "suspension_velocity_sensor",
        {METADATA_KEY: json.dumps(metadata, sort_keys=True)},
    )


def _operations(network: PackedNetwork) -> list[Operation]:
    seen = "seen" if network.residual else "measured"
    return [
        operation("Sub", f"{seen} input_mean", "centred"),
        operation("Div", "centred input_std", "standardised"),
        operation("Gemm", "standardised sample_W sample_B", "sample_gates", transB=1),
        operation("Reshape", "sample_gates two_rows", "both_gates"),
        operation("Split", "both_gates one_each", "begin_gates backward_gates", axis=0),
        operation("Gemm", "hidden forward_R begin_gates", "flight_gates", transB=1),
        operation("Concat", "begin_gates flight_gates backward_gates", "gates", axis=0),
        operation("Split", "gates each", "input_gate output_gate forget_gate candidate", axis=1),
        operation("Sigmoid", "input_gate", "input_open"),
        operation("Sigmoid", "output_gate", "output_open"),
        operation("Sigmoid", "forget_gate", "forget_open"),
        operation("Tanh", "candidate", "bounded"),
        operation("Mul", "forget_open cell", "kept"),
        operation("Mul", "input_open bounded", "gained"),
        operation("Add", "kept gained", "next_cell"),
        operation("Tanh", "next_cell", "cell_bounded"),
        operation("Mul", "output_open cell_bounded", "next_hidden"),
        operation("Slice", "next_hidden complete_row end_row", "complete"),
        operation("Reshape", "complete one_row", "features"),
        operation("Gemm", "features dense_W dense_B", "dense", transB=1),
        operation("Relu", "dense", "rectified"),
        operation("Gemm", "rectified velocity_W velocity_B", "estimate", transB=1),
    ]


def _constants(network: PackedNetwork) -> Arrays:
    """Return the arrays that differ from the windowed form's: both directions' gates of a sample
    below each other, in the order input, output, forget, cell, and the output's deviation and mean
    in its layer.
    """
    a, units, window = network.arrays, network.units, network.window
    gates = {}
    for part in "WB":
        into, candidate, out = np.split(a[f"backward_{part}"], 3)
        forget = np.zeros_like(into)  # a first cell has nothing to forget
        both = [a[f"forward_{part}"], into, out, forget, candidate]
        gates[f"sample_{part}"] = np.concatenate(both)
    std, mean = (a[f"output_{name}"].astype(np.float64) for name in ("std", "mean"))
    wholes = {
        "two_rows": [2, 4 * units], "one_each": [1, 1], "each": 4 * [units],
        "complete_row": [window - 1], "end_row": [window + 1], "one_row": [1, 2 * units],
    }  # fmt: skip
    return {
        **gates,
        "velocity_W": (a["output_W"] * std[:, np.newaxis]).astype(np.float32),
        "velocity_B": (a["output_B"] * std + mean).astype(np.float32),
        **{name: np.array(value, dtype=np.int64) for name, value in wholes.items()},
    }
