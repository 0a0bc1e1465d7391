"""Time per sample of the sensor, one thread: `python tests/benchmarks/bench_sensor.py [MODEL]`.

Beside the run time stands the same network with its backward direction run over the whole window,
as a framework's exporter would write it. Without a model, weights are random: they do not change
the time.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import onnxruntime as ort
import torch
from onnx import helper, numpy_helper

from sensor.export import build_windowed, export_windowed
from sensor.network import BiLstmNetwork
from sensor.runtime import OnnxSensor

SAMPLES = 3000


def with_full_backward(model: onnx.ModelProto, units: int) -> onnx.ModelProto:
    """Replace LSTM and backward cell by one bidirectional LSTM (random weights, for timing)."""
    graph, rng = model.graph, np.random.default_rng(0)
    shapes = {"W": (2, 4 * units, 14), "R": (2, 4 * units, units), "B": (2, 8 * units)}
    weights = [
        numpy_helper.from_array(rng.normal(scale=0.05, size=shape).astype(np.float32), name)
        for name, shape in shapes.items()
    ]
    nodes = [
        helper.make_node(
            "LSTM", ["time_major", "W", "R", "B"], ["sequence"],
            hidden_size=units, direction="bidirectional",
        ),
        helper.make_node("Gather", ["sequence", "last"], ["both"], axis=0),
        helper.make_node("Transpose", ["both"], ["batch_first"], perm=[1, 0, 2]),
        helper.make_node("Flatten", ["batch_first"], ["features"]),
    ]  # fmt: skip
    names = [node.output[0] for node in graph.node]
    start, stop = names.index("time_major") + 1, names.index("features") + 1
    kept = [*graph.node[:start], *nodes, *graph.node[stop:]]
    del graph.node[:]
    graph.node.extend(kept)
    graph.initializer.extend(weights)
    return model


def microseconds(step: Callable[[int], object]) -> tuple[float, float]:
    """Median and 99th percentile of SAMPLES calls, after a tenth of them to warm up."""
    times = np.zeros(SAMPLES)
    for k in range(SAMPLES):
        start = time.perf_counter()
        step(k)
        times[k] = time.perf_counter() - start
    times = 1e6 * times[SAMPLES // 10 :]
    return float(np.median(times)), float(np.percentile(times, 99))


def main() -> None:
    """Print one line per form: median and 99th percentile in microseconds per sample."""
    torch.set_num_threads(1)
    network = BiLstmNetwork().eval()
    samples = np.random.default_rng(0).normal(size=(SAMPLES, 14))
    command = np.full(4, 0.3)
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    full = ort.InferenceSession(
        with_full_backward(build_windowed(network), network.config.units).SerializeToString(),
        options,
    )
    window = samples[np.newaxis, :19].astype(np.float32)
    tensor = torch.from_numpy(window)
    with tempfile.TemporaryDirectory() as directory:
        model = sys.argv[1] if len(sys.argv) > 1 else Path(directory) / "net.onnx"
        if isinstance(model, Path):
            export_windowed(network, model)
        onnx_sensor = OnnxSensor(model)
    with torch.inference_mode():
        forms: dict[str, Callable[[int], object]] = {
            "run time (one backward step)": lambda k: onnx_sensor.step(samples[k], command),
            "ONNX, full backward direction": lambda _: full.run(None, {"measured": window}),
            "torch, one backward step": lambda _: network(tensor),
        }
        print(f"{'microseconds per sample':32s}{'median':>8s}{'p99':>8s}")
        for name, step in forms.items():
            median, worst = microseconds(step)
            print(f"{name:32s}{median:8.0f}{worst:8.0f}")


if __name__ == "__main__":
    main()
