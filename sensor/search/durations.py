"""How long networks of different shapes take for one sample, measured in turns in one run: the
duration column of Table 3.

The weights are drawn, not trained: the time depends on the shape alone.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import onnxruntime as ort
import torch

from sensor.export import build_windowed
from sensor.network import BiLstmNetwork, NetworkConfig


@dataclass(frozen=True)
class Shape:
    """Window [samples], units of the LSTM and of the dense layer."""

    window: int
    units: int
    hidden: int


def durations(shapes: Sequence[Shape], samples: int) -> list[float]:
    """Return the median time [s] of one sample (ONNX Runtime, one thread, batch 1) for each shape.

    The networks take turns sample by sample, so that whatever else the machine does meets all.
    """
    torch.manual_seed(0)
    sessions = [_session(shape) for shape in shapes]
    rng = np.random.default_rng(0)
    inputs = [
        {"measured": rng.normal(size=(1, shape.window, 14)).astype(np.float32)} for shape in shapes
    ]
    taken = np.empty((samples, len(shapes)))
    for row in taken:
        for i, (session, measured) in enumerate(zip(sessions, inputs, strict=True)):
            start = time.perf_counter()
            session.run(None, measured)
            row[i] = time.perf_counter() - start
    return [float(value) for value in np.median(taken, axis=0)]


def _session(shape: Shape) -> ort.InferenceSession:
    config = NetworkConfig(shape.window, units=shape.units, hidden=shape.hidden)
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    model = build_windowed(BiLstmNetwork(config)).SerializeToString()
    return ort.InferenceSession(model, options, providers=["CPUExecutionProvider"])
