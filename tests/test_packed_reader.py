"""ONNX files of this project and of others, read by their structure."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx import helper, numpy_helper
from packed_sensor import (
    PackedSensor,
    carried_network,
    drive,
    exported,
    windowed_network,
)

from sensor.channels import CHANNEL_NAMES, CHANNEL_UNITS, OUTPUT_NAMES, OUTPUT_UNITS
from sensor.errors import SensorError
from sensor.packed import blob, read_network
from sensor.packed.layout import MOST
from sensor.runtime import OnnxSensor

WINDOW, UNITS, HIDDEN = 6, 5, 7
METADATA = {
    "window": WINDOW,
    "sample_rate_hz": 100,
    "inputs": {"names": CHANNEL_NAMES, "units": CHANNEL_UNITS},
    "outputs": {"names": OUTPUT_NAMES, "units": OUTPUT_UNITS},
}


class Foreign(torch.nn.Module):
    """The structure as somebody else would write it."""

    def __init__(self, tap: Callable[[torch.Tensor], torch.Tensor], scaled: bool = True) -> None:
        super().__init__()
        self.lstm = torch.nn.LSTM(14, UNITS, batch_first=True, bidirectional=True)
        self.one, self.other = torch.nn.Linear(2 * UNITS, HIDDEN), torch.nn.Linear(HIDDEN, 4)
        self.dropout, self.tap, self.scaled = torch.nn.Dropout(0.5), tap, scaled
        self.register_buffer("mean", torch.linspace(-1.0, 1.0, 14))
        self.register_buffer("std", torch.linspace(0.5, 20.0, 14))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        if self.scaled:
            x = (x - self.mean) / self.std
        sequence = self.lstm(x)[0]
        found = self.other(self.dropout(torch.relu(self.one(self.tap(sequence)))))
        return 0.3 * found + 0.01 if self.scaled else found


def last(sequence: torch.Tensor) -> torch.Tensor:
    return sequence[:, -1]


def last_sliced(sequence: torch.Tensor) -> torch.Tensor:
    return sequence[:, WINDOW - 1 :, :].flatten(1)


def last_halves(sequence: torch.Tensor) -> torch.Tensor:
    """The backward half first: the columns of the dense layer stand the other way round."""
    tapped = sequence[:, -1]
    return torch.cat([tapped[:, UNITS:], tapped[:, :UNITS]], dim=1)


def with_metadata(model: onnx.ModelProto, path: Path) -> Path:
    helper.set_model_props(model, {"sensor": json.dumps(METADATA)})
    onnx.save(model, path)
    return path


def by_torch(module: torch.nn.Module, path: Path, open_batch: bool = True) -> Path:
    """Export with torch's own exporter, add the metadata."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of its age, and of every shape it traces
        torch.onnx.export(
            module.eval(), (torch.zeros(1, WINDOW, 14),), str(path), dynamo=False,
            input_names=["x"], dynamic_axes={"x": {0: "batch"}} if open_batch else None,
        )  # fmt: skip
    return with_metadata(onnx.load(path), path)


@pytest.mark.parametrize("tap", [last, last_sliced, last_halves])
@pytest.mark.parametrize("open_batch", [False, True])
def test_torchs_own_exports_are_read(library, tmp_path: Path, tap, open_batch: bool) -> None:  # type: ignore[no-untyped-def]
    torch.manual_seed(1)
    path = by_torch(Foreign(tap), tmp_path / "foreign.onnx", open_batch)
    channels, commands = drive(40)
    got = PackedSensor(library, blob(read_network(path))).run(channels, commands)[0]
    sensor = OnnxSensor(path)
    for k in range(len(channels)):
        counts = sensor.step(channels[k], commands[k])
        assert counts == (k >= WINDOW - 1)
        if counts:
            np.testing.assert_allclose(got[k], sensor.estimate, rtol=0.0, atol=1e-5)


def test_a_network_without_normalisation_is_read(library, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    network = read_network(by_torch(Foreign(last, scaled=False), tmp_path / "n.onnx"))
    assert np.array_equal(network.arrays["input_std"], np.ones(14))
    assert np.array_equal(network.arrays["output_mean"], np.zeros(4))


@pytest.mark.parametrize(
    ("tap", "said"),
    [
        (lambda s: s[:, 0], "Gemm.* does not read both directions at the last sample"),
        (lambda s: s[:, -1] * 2.0 + torch.tanh(s[:, -1]), "operator Tanh .* stands where none"),
        (lambda s: s.mean(dim=1), "operator ReduceMean .* is not supported"),
        (lambda s: torch.sigmoid(s[:, -1]), "operator Sigmoid .* stands where none is supported"),
        (lambda s: s[:, -1] + s[:, 0], "operator Add .* of two signals"),
    ],
)
def test_another_tap_is_refused(tmp_path: Path, tap, said: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(SensorError, match=said):
        read_network(by_torch(Foreign(tap), tmp_path / "foreign.onnx"))


class Gru(Foreign):
    def __init__(self) -> None:
        super().__init__(last)
        self.lstm = torch.nn.GRU(14, UNITS, batch_first=True, bidirectional=True)  # type: ignore[assignment]


class OneWay(Foreign):
    def __init__(self) -> None:
        super().__init__(last)
        self.lstm = torch.nn.LSTM(14, 2 * UNITS, batch_first=True)


class TwoLayers(Foreign):
    def __init__(self) -> None:
        super().__init__(last)
        self.lstm = torch.nn.LSTM(14, UNITS, num_layers=2, batch_first=True, bidirectional=True)


class FiveOutputs(Foreign):
    def __init__(self) -> None:
        super().__init__(last)
        self.other = torch.nn.Linear(HIDDEN, 5)


@pytest.mark.parametrize(
    ("module", "said"),
    [
        (Gru, r"operator GRU \('/lstm/GRU'\) is not supported"),
        (OneWay, "does not read both directions"),
        (TwoLayers, "is the second LSTM, where one is supported"),
        (FiveOutputs, "its output has 5 values, where 4 belong"),
    ],
)
def test_another_structure_is_refused(tmp_path: Path, module, said: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(SensorError, match=said):
        read_network(by_torch(module(), tmp_path / "foreign.onnx"))


@pytest.fixture(scope="module")
def windowed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return exported(windowed_network(4, 5, 6, True), tmp_path_factory.mktemp("windowed"))


@pytest.fixture(scope="module")
def carried(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return exported(carried_network(5, 6, 7), tmp_path_factory.mktemp("carried"))


def edited(path: Path, folder: Path, edit: Callable[[onnx.ModelProto], object]) -> Path:
    model = onnx.load(path)
    edit(model)
    onnx.save(model, folder / "edited.onnx")
    return folder / "edited.onnx"


def renamed(model: onnx.ModelProto) -> None:
    """Give every inner value another name, and take names from the nodes."""
    graph = model.graph
    kept = {port.name for port in (*graph.input, *graph.output)} | {""}
    inner = sorted({name for node in graph.node for name in (*node.input, *node.output)} - kept)
    names = {name: f"v{number}" for number, name in enumerate(inner)}
    for node in graph.node:
        for values in (node.input, node.output):
            values[:] = [names.get(name, name) for name in values]
    for weight in graph.initializer:
        weight.name = names.get(weight.name, weight.name)


def as_constant_nodes(model: onnx.ModelProto) -> None:
    """Turn weights into Constant operators."""
    graph = model.graph
    nodes = [
        helper.make_node("Constant", [], [weight.name], value=weight)
        for weight in graph.initializer
    ]
    del graph.initializer[:]
    kept = list(graph.node)
    del graph.node[:]
    graph.node.extend([*nodes, *kept])


@pytest.mark.parametrize("edit", [renamed, as_constant_nodes])
@pytest.mark.parametrize("kind", ["windowed", "carried"])
def test_names_do_not_matter(
    tmp_path: Path,
    kind: str,
    edit: Callable[[onnx.ModelProto], object],
    request: pytest.FixtureRequest,
) -> None:
    path = request.getfixturevalue(kind)
    changed = edited(path, tmp_path, edit)
    assert blob(read_network(changed)) == blob(read_network(path))


def constant(model: onnx.ModelProto, name: str, change: Callable[[np.ndarray], np.ndarray]) -> None:
    for weight in model.graph.initializer:
        if weight.name == name:
            weight.CopyFrom(numpy_helper.from_array(change(numpy_helper.to_array(weight)), name))


def operator(model: onnx.ModelProto, output: str, kind: str) -> None:
    next(node for node in model.graph.node if output in node.output).op_type = kind


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda m: operator(m, "front", "Sigmoid"), "operator Sigmoid .*: Tanh .* belongs"),
        (lambda m: operator(m, "level", "Exp"), "operator Exp .*: Sqrt .* belongs"),
        (lambda m: constant(m, "i_ax", lambda a: a + 1), "'i_ax' is .*1.*, where .*0.* belongs"),
        (lambda m: constant(m, "leads", lambda a: a[:, 1:]), "shape .* belongs"),
        (lambda m: constant(m, "age_most", lambda a: a + 9), "reach beyond the 128 samples"),
        (lambda m: constant(m, "front_B", lambda a: a * np.nan), "'front_B' hold a NaN"),
        (lambda m: constant(m, "front_B", lambda a: a.astype(np.float16)), "of type float16"),
        (lambda m: m.graph.output.pop(), "no input or output next_cell"),
        (lambda m: m.metadata_props.pop(), "no entry 'sensor'"),
    ],
)
def test_another_carried_network_is_refused(
    carried: Path, tmp_path: Path, edit: Callable[[onnx.ModelProto], object], said: str
) -> None:
    with pytest.raises(SensorError, match=said):
        read_network(edited(carried, tmp_path, edit))


def widened(model: onnx.ModelProto) -> None:
    model.graph.input[0].type.tensor_type.shape.dim[2].dim_value = 15


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda m: operator(m, "rectified", "Elu"), "operator Elu is not supported"),
        (lambda m: operator(m, "steer_cosine", "Sin"), "operator Sin .*: Cos .* belongs"),
        (lambda m: constant(m, "dense_W", lambda a: a[:, 1:]), "Gemm does not fit its inputs"),
        (lambda m: constant(m, "input_std", lambda a: a * np.inf), "multiplied by zero"),
        (lambda m: constant(m, "slip", lambda a: a[:, :3]), r"shape \[14, 3\], where \[14, 4\]"),
        (widened, r"'measured' is \['batch', 4, 15\], where \[batch, 4, 14\] belongs"),
    ],
)
def test_another_windowed_network_is_refused(
    windowed: Path, tmp_path: Path, edit: Callable[[onnx.ModelProto], object], said: str
) -> None:
    with pytest.raises(SensorError, match=said):
        read_network(edited(windowed, tmp_path, edit))


def without_recurrent_weights(model: onnx.ModelProto) -> None:
    lstm = next(node for node in model.graph.node if node.op_type == "LSTM")
    lstm.input[2] = ""


def without_an_input(model: onnx.ModelProto) -> None:
    next(node for node in model.graph.node if node.op_type == "Relu").input[0] = ""


def without_an_output(model: onnx.ModelProto) -> None:
    del next(node for node in model.graph.node if node.op_type == "LSTM").output[:]


def in_no_direction(model: onnx.ModelProto) -> None:
    lstm = next(node for node in model.graph.node if node.op_type == "LSTM")
    lstm.attribute.append(helper.make_attribute("direction", "sideways"))


def within_a_number(model: onnx.ModelProto) -> None:
    weight = next(w for w in model.graph.initializer if w.name == "dense_W")
    weight.raw_data = weight.raw_data[:-1]


def without_a_depth(model: onnx.ModelProto) -> None:
    line = next(port for port in model.graph.input if port.name == "line")
    line.type.tensor_type.ClearField("shape")


def saying(key: str, value: object) -> Callable[[onnx.ModelProto], None]:
    def edit(model: onnx.ModelProto) -> None:
        entry = next(p for p in model.metadata_props if p.key == "sensor")
        entry.value = json.dumps({**json.loads(entry.value), key: value})

    return edit


@pytest.mark.parametrize(
    ("kind", "edit", "said"),
    [
        ("windowed", without_recurrent_weights, "operator LSTM .*has no weights of three"),
        ("windowed", without_an_input, "operator Relu .*has no input"),
        ("windowed", without_an_output, "operator LSTM .*has no output"),
        ("windowed", in_no_direction, "operator LSTM .*with direction 'sideways'"),
        ("windowed", within_a_number, "constant 'dense_W' ends within a number"),
        ("carried", without_a_depth, r"'line' is \[\], where \[depth, signals\]"),
        ("windowed", saying("window", float("inf")), "misspells cannot convert float infinity"),
        ("carried", saying("inputs", {"names": 3, "units": 4}), "misspells 'int' object"),
    ],
)
def test_a_damaged_network_is_refused(
    kind: str,
    edit: Callable[[onnx.ModelProto], object],
    said: str,
    tmp_path: Path,
    request: pytest.FixtureRequest,
) -> None:
    with pytest.raises(SensorError, match=said):
        read_network(edited(request.getfixturevalue(kind), tmp_path, edit))


def test_a_damaged_network_is_one_sentence_at_run_time(
    windowed: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """ONNX Runtime's own lines do not come before it."""
    with pytest.raises(SensorError, match="ONNX Runtime cannot read it as a network"):
        OnnxSensor(edited(windowed, tmp_path, in_no_direction))
    assert capfd.readouterr().err == ""


def test_a_shape_beyond_the_c_sensors_is_named(library, windowed: Path, carried: Path) -> None:  # type: ignore[no-untyped-def]
    """The limits are the C sensor's own: it takes what is at them."""
    network = read_network(windowed)
    PackedSensor(library, blob(replace(network, window=MOST)))
    with pytest.raises(SensorError, match="4097 samples in a window, where at most 4096 are"):
        blob(replace(network, window=MOST + 1))
    network = read_network(carried)
    with pytest.raises(SensorError, match="5000 samples of the delay line, where at most 4096"):
        blob(replace(network, arrays={**network.arrays, "depth": np.array(5000)}))


def test_what_is_no_onnx_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.onnx").write_text("hello")
    with pytest.raises(SensorError, match=r"text\.onnx: it is no ONNX model"):
        read_network(tmp_path / "text.onnx")
    with pytest.raises(SensorError, match="cannot be read"):
        read_network(tmp_path / "none.onnx")


def test_files_cut_short_are_refused(windowed: Path, tmp_path: Path) -> None:
    content = windowed.read_bytes()
    for size in range(0, len(content), max(1, len(content) // 60)):
        (tmp_path / "cut.onnx").write_bytes(content[:size])
        with pytest.raises(SensorError):
            read_network(tmp_path / "cut.onnx")


def test_neither_torch_nor_the_package_onnx_is_needed(windowed: Path, carried: Path) -> None:
    code = (
        "import sys; sys.modules['onnx'] = sys.modules['torch'] = None\n"
        "from sensor.packed import blob, read_network\n"
        "for path in sys.argv[1:]: print(len(blob(read_network(path))))"
    )
    command = [sys.executable, "-c", code, str(windowed), str(carried)]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    sizes = [len(blob(read_network(path))) for path in (windowed, carried)]
    assert [int(line) for line in run.stdout.split()] == sizes
