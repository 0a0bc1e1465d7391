"""The same windowed network in every form that runs it from Python: what is timed, and checked to
give the same estimates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import onnx
import torch
from onnx import helper, numpy_helper

from sensor.channels import CHANNELS
from sensor.export import build_windowed, export_windowed
from sensor.network import BiLstmNetwork, NetworkConfig
from sensor.packed import read_network
from sensor.runtime import session_of
from sensor.streaming.form import StreamingForm
from sensor.streaming.graph import streaming_model
from sensor.window import Window
from sensor.windowed import WindowedForm

Array = npt.NDArray[np.float64]
PLAIN: Final = "ONNX Runtime, windowed"
STREAMING: Final = "ONNX Runtime, streaming"
_GATES: Final = [0, 3, 1, 2]  # torch's input, forget, cell, output in the order of ONNX


@dataclass(frozen=True)
class Form:
    """A name, what takes one sample (14,), and where the estimates (4,) [m/s] are then; None for
    what computes no estimates.
    """

    name: str
    take: Callable[[Array], Any]
    estimate: Callable[[], npt.NDArray[Any]] | None


@dataclass(frozen=True)
class Subject:
    """One network of random weights: torch's own bidirectional layer, ours with the same weights,
    and both as ONNX files.
    """

    config: NetworkConfig
    lstm: torch.nn.LSTM
    network: BiLstmNetwork
    model: Path
    plain: Path


def subject(window: int, units: int, hidden: int, folder: Path) -> Subject:
    """Draw a network and write its files to `folder`."""
    torch.manual_seed(units)
    config = NetworkConfig(window=window, units=units, hidden=hidden)
    network = BiLstmNetwork(config).eval()
    lstm = torch.nn.LSTM(config.channels, units, batch_first=True, bidirectional=True).eval()
    network.load_bidirectional(lstm)
    name = f"w{window}_{units}_{hidden}"
    model = export_windowed(network, folder / f"{name}.onnx")
    plain = folder / f"{name}_plain.onnx"
    onnx.save(bidirectional(build_windowed(network), lstm), str(plain))
    return Subject(config, lstm, network, model, plain)


def bidirectional(model: onnx.ModelProto, lstm: torch.nn.LSTM) -> onnx.ModelProto:
    """Replace LSTM and backward cell by one bidirectional operator over the whole window, as
    another exporter writes it.
    """
    graph, units = model.graph, lstm.hidden_size
    weights = {
        "both_W": _stacked(lstm, "weight_ih_l0", units),
        "both_R": _stacked(lstm, "weight_hh_l0", units),
        "both_B": np.hstack([_stacked(lstm, f"bias_{part}_l0", units) for part in ("ih", "hh")]),
    }
    nodes = [
        helper.make_node(
            "LSTM", ["time_major", *weights], ["sequence"],
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
    used = {given for node in kept for given in node.input}
    initializers = [tensor for tensor in graph.initializer if tensor.name in used]
    initializers += [numpy_helper.from_array(array, name) for name, array in weights.items()]
    del graph.initializer[:]
    graph.initializer.extend(initializers)
    onnx.checker.check_model(model, full_check=True)
    return model


def _stacked(lstm: torch.nn.LSTM, name: str, units: int) -> npt.NDArray[np.float32]:
    """Return a weight of both directions (2, 4 units, ...) in the order of ONNX."""
    rows = [getattr(lstm, name + end).detach().numpy() for end in ("", "_reverse")]
    return np.stack([r.reshape(4, units, -1)[_GATES].reshape(r.shape) for r in rows])


def forms(s: Subject) -> Iterator[Form]:
    """Yield what this machine has; OpenVINO is left out where it is not installed."""
    yield _torch("torch, windowed", s, whole_layer=True)
    yield _torch("torch, one backward step", s, whole_layer=False)
    yield _windowed(PLAIN, s, s.plain)
    yield _windowed("ONNX Runtime, one backward step", s, s.model)
    streaming = StreamingForm(session_of(streaming_model(read_network(s.model))))
    yield Form(STREAMING, streaming.take, lambda: streaming.output[0])
    yield from _openvino(s)
    yield from _floors(s)


def _torch(name: str, s: Subject, whole_layer: bool) -> Form:
    window = Window(s.config.window)
    given = torch.from_numpy(window.values)[np.newaxis]
    result = np.full(4, np.nan)
    network = s.network

    def features(windows: torch.Tensor) -> torch.Tensor:
        found: torch.Tensor = s.lstm(windows)[0][:, -1]
        return found

    def take(sample: Array) -> None:
        window.push(sample)
        with torch.inference_mode():
            if not whole_layer:
                result[:] = network(given)[0]
                return
            x = (given - network.input_mean) / network.input_std
            y = network.output(torch.relu(network.dense(features(x))))
            result[:] = (y * network.output_std + network.output_mean)[0]

    return Form(name, take, lambda: result)


def _windowed(name: str, s: Subject, model: Path) -> Form:
    form = WindowedForm(session_of(str(model)), s.config.window)
    return Form(name, form.take, lambda: form.output[0])


def _openvino(s: Subject) -> Iterator[Form]:
    """Single precision is asked for: on some processors it takes half of it silently."""
    try:
        import openvino
    except ImportError:
        return
    core = openvino.Core()
    settings = {
        "INFERENCE_NUM_THREADS": 1, "NUM_STREAMS": 1, "PERFORMANCE_HINT": "LATENCY",
        "INFERENCE_PRECISION_HINT": "f32",
    }  # fmt: skip
    for name, path in (("windowed", s.plain), ("one backward step", s.model)):
        model = core.read_model(path)
        model.reshape([1, s.config.window, len(CHANNELS)])
        request = core.compile_model(model, "CPU", settings).create_infer_request()
        yield _inferred(f"OpenVINO, {name}", request, openvino, s.config.window)


def _inferred(name: str, request: Any, openvino: Any, length: int) -> Form:
    window = Window(length)
    request.set_input_tensor(openvino.Tensor(window.values[np.newaxis], shared_memory=True))
    output = request.get_output_tensor()

    def take(sample: Array) -> None:
        window.push(sample)
        request.infer()

    return Form(name, take, lambda: output.data[0])


def _floors(s: Subject) -> Iterator[Form]:
    """Yield one product of the streaming form's shape: below that nothing exact can come."""
    rows, units = s.config.window - 1, s.config.units
    random = np.random.default_rng(0)
    state = random.normal(size=(rows, units)).astype(np.float32)
    weights = random.normal(size=(units, 4 * units)).astype(np.float32)
    product = np.empty((rows, 4 * units), dtype=np.float32)
    yield Form("sgemm, numpy", lambda _: np.matmul(state, weights, out=product), None)
    node = helper.make_node("MatMul", ["state", "weights"], ["product"])
    ports = [
        helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, list(array.shape))
        for name, array in (("state", state), ("product", product))
    ]
    graph = helper.make_graph(
        [node], "product", ports[:1], ports[1:], [numpy_helper.from_array(weights, "weights")]
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    session = session_of(model.SerializeToString())
    binding = session.io_binding()
    binding.bind_input("state", "cpu", 0, np.float32, state.shape, state.ctypes.data)
    binding.bind_output("product", "cpu", 0, np.float32, product.shape, product.ctypes.data)
    yield Form("sgemm, ONNX Runtime", lambda _: session.run_with_iobinding(binding), None)
    a, b, out = (torch.from_numpy(array) for array in (state, weights, product.copy()))
    yield Form("sgemm, torch", lambda _: torch.mm(a, b, out=out), None)
