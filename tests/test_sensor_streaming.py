"""The streaming form of windowed networks: torch = windows = streaming, over shapes, at the start,
after a reset, around a NaN.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import numpy.typing as npt
import onnx
import pytest
import torch
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.cli import main
from sensor.errors import SensorError
from sensor.estimators import MODELS
from sensor.export import export_windowed
from sensor.features import WHEEL_SPEEDS
from sensor.network import BiLstmNetwork, NetworkConfig
from sensor.packed import read_network
from sensor.runtime import OnnxSensor, open_session, session_of
from sensor.streaming.export import export_streaming
from sensor.streaming.graph import streaming_model

Array = npt.NDArray[np.float64]
TOLERANCE = 1e-5  # m/s
NO_COMMANDS = np.zeros((0, 4))
SHIPPED = sorted(MODELS.glob("bilstm_*.onnx"))


def random_network(config: NetworkConfig, seed: int) -> BiLstmNetwork:
    """Weights larger than a fresh network's, so that the cells bend; the spread of a car's
    channels.
    """
    torch.manual_seed(seed)
    network = BiLstmNetwork(config)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.mul_(2.0)
    network.input_std.copy_(torch.linspace(0.2, 3.0, 14))
    network.input_mean.copy_(torch.linspace(-1.0, 1.0, 14))
    network.input_mean[6], network.input_std[6] = 20.0, 8.0
    if not config.residual:
        network.input_mean[WHEEL_SPEEDS], network.input_std[WHEEL_SPEEDS] = 20.0, 8.0
    network.output_std.fill_(0.2)
    return network.eval()


def drive(samples: int, seed: int = 0) -> Array:
    """Channels (samples, 14) of a car at 20 m/s, in single precision, as the networks take them."""
    random = np.random.default_rng(seed)
    channels = random.normal(scale=0.3, size=(samples, 14))
    channels[:, 6] += 20.0
    channels[:, WHEEL_SPEEDS] = 20.0 + random.normal(scale=0.1, size=(samples, 4))
    return channels.astype(np.float32).astype(np.float64)


def by_torch(network: BiLstmNetwork, channels: Array) -> Array:
    window = network.config.window
    windows = np.lib.stride_tricks.sliding_window_view(channels, window, axis=0)
    with torch.no_grad():
        estimates = network(torch.from_numpy(windows.transpose(0, 2, 1).astype(np.float32)))
    return np.vstack([np.full((window - 1, 4), np.nan), estimates.double().numpy()])


def by_windows(model: Path, channels: Array) -> Array:
    """The file as it is, one window at a time."""
    session = open_session(model)
    window = session.get_inputs()[0].shape[1]
    windows = np.lib.stride_tricks.sliding_window_view(channels, window, axis=0)
    rows = [
        np.asarray(session.run(None, {"measured": w.T[np.newaxis].astype(np.float32)})[0])[0]
        for w in windows
    ]
    return np.vstack([np.full((window - 1, 4), np.nan), np.array(rows, dtype=np.float64)])


def by_steps(sensor: OnnxSensor, channels: Array) -> Array:
    rows = np.full((len(channels), 4), np.nan)
    for row, sample in zip(rows, channels, strict=True):
        if sensor.step(sample, NO_COMMANDS):
            row[:] = sensor.estimate
    return rows


@settings(max_examples=8, deadline=None)
@given(
    window=st.integers(2, 30),
    units=st.integers(1, 70),
    hidden=st.integers(1, 40),
    residual=st.booleans(),
    seed=st.integers(0, 1000),
)
def test_torch_windows_and_streaming_are_equal(
    window: int, units: int, hidden: int, residual: bool, seed: int
) -> None:
    config = NetworkConfig(window=window, units=units, hidden=hidden, residual=residual)
    network, channels = random_network(config, seed), drive(window + 40, seed)
    with TemporaryDirectory() as folder:
        model = export_windowed(network, Path(folder) / "net.onnx")
        sensor = OnnxSensor(model)
        assert sensor.streaming
        expected = by_torch(network, channels)
        for _ in range(2):  # the second time after a reset
            np.testing.assert_allclose(by_steps(sensor, channels), expected, rtol=0, atol=TOLERANCE)
            sensor.reset()
        np.testing.assert_allclose(by_windows(model, channels), expected, rtol=0, atol=TOLERANCE)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> tuple[BiLstmNetwork, Path]:
    network = random_network(NetworkConfig(window=7, units=20, hidden=12), 3)
    return network, export_windowed(network, tmp_path_factory.mktemp("small") / "net.onnx")


@pytest.mark.parametrize("model", SHIPPED, ids=lambda path: path.stem)
def test_shipped_networks_run_in_their_streaming_form(model: Path) -> None:
    sensor, channels = OnnxSensor(model), drive(300)
    assert sensor.streaming
    streamed = by_steps(sensor, channels)
    assert np.isfinite(streamed[sensor.info.window - 1 :]).all()
    np.testing.assert_allclose(streamed, by_windows(model, channels), rtol=0, atol=TOLERANCE)
    np.testing.assert_array_equal(streamed, sensor.apply(channels, NO_COMMANDS))


@pytest.mark.parametrize("residual", [False, True])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_bad_sample_is_in_exactly_the_windows_that_hold_it(
    residual: bool, bad: float, tmp_path: Path
) -> None:
    """Before the first window is full, in the middle, and in two samples close together."""
    network = random_network(NetworkConfig(window=7, units=20, hidden=12, residual=residual), 1)
    sensor = OnnxSensor(export_windowed(network, tmp_path / "net.onnx"))
    channels = drive(80)
    clean = sensor.apply(channels, NO_COMMANDS)
    spoilt = channels.copy()
    spoilt[[3, 30, 34, 60], [0, 5, 6, 13]] = bad
    estimates = sensor.apply(spoilt, NO_COMMANDS)
    holding = np.zeros(80, dtype=bool)
    for k in (3, 30, 34, 60):
        holding[k : k + 7] = True
    holding[:6] = True  # the window fills
    if np.isnan(bad):
        np.testing.assert_array_equal(np.isnan(estimates).all(axis=1), holding)
    np.testing.assert_array_equal(estimates[~holding], clean[~holding])


def test_a_refused_sample_changes_nothing(small: tuple[BiLstmNetwork, Path]) -> None:
    sensor, channels = OnnxSensor(small[1]), drive(40)
    expected = sensor.apply(channels, NO_COMMANDS)
    for k, sample in enumerate(channels):
        with pytest.raises(SensorError, match=r"Car\.vx is nan"):
            sensor.step(np.where(np.arange(14) == 6, np.nan, sample), NO_COMMANDS)
        assert sensor.step(sample, NO_COMMANDS) is (k >= 6)
        np.testing.assert_array_equal(sensor.estimate, expected[k])


def test_two_sensors_and_a_whole_run_between_two_steps(small: tuple[BiLstmNetwork, Path]) -> None:
    one, other, channels = OnnxSensor(small[1]), OnnxSensor(small[1]), drive(40)
    expected = one.apply(channels, NO_COMMANDS)
    for k, sample in enumerate(channels):
        one.step(sample, NO_COMMANDS)
        other.step(channels[-1 - k], NO_COMMANDS)
        if k == 20:
            one.apply(channels[:15], NO_COMMANDS)
        np.testing.assert_array_equal(one.estimate, expected[k])


def test_the_file_for_other_tools_streams_with_plain_copies(
    small: tuple[BiLstmNetwork, Path], tmp_path: Path
) -> None:
    """Any runtime, as docs/streaming.md says: whole arrays in and out, rows copied."""
    network, model = small
    path = tmp_path / "streaming.onnx"
    export_streaming(model, path)
    onnx.checker.check_model(onnx.load(path), full_check=True)
    session = session_of(path.read_bytes())
    rows, units = (node.shape for node in session.get_inputs() if node.name == "cell").__next__()
    hidden = np.zeros((rows - 2, units), dtype=np.float32)
    cell = np.zeros((rows, units), dtype=np.float32)
    channels = drive(40)
    expected = by_torch(network, channels)
    for k, sample in enumerate(channels):
        given = {"measured": sample[np.newaxis].astype(np.float32), "hidden": hidden, "cell": cell}
        estimate, after, cells = session.run(None, given)
        hidden = after[: rows - 2]
        cell[1:-1] = cells[: rows - 2]
        if k >= 6:
            np.testing.assert_allclose(estimate[0], expected[k], rtol=0, atol=TOLERANCE)


def test_a_network_is_not_written_over_itself_nor_over_a_device(
    small: tuple[BiLstmNetwork, Path], tmp_path: Path
) -> None:
    model, pipe = tmp_path / "windowed.onnx", tmp_path / "null"
    model.write_bytes(small[1].read_bytes())
    os.mkfifo(pipe)
    for out, words in (
        (model, "is the file that is read"),
        (pipe, "the name of a network ends in .onnx"),
        (tmp_path / "none" / "a.onnx", "there is no folder"),
    ):
        done = CliRunner().invoke(
            main, ["sensor", "export", str(model), "-o", str(out), "--streaming"]
        )
        assert done.exit_code == 2
        assert words in done.output
    assert model.read_bytes() == small[1].read_bytes()
    assert pipe.is_fifo()


def test_a_streaming_file_in_a_windowed_ones_place_is_named(
    small: tuple[BiLstmNetwork, Path], tmp_path: Path
) -> None:
    path = tmp_path / "streaming.onnx"
    export_streaming(small[1], path)
    with pytest.raises(SensorError, match="give the windowed file"):
        OnnxSensor(path)


def test_networks_of_another_structure_run_as_they_are(
    small: tuple[BiLstmNetwork, Path], tmp_path: Path
) -> None:
    network, model = small
    other = onnx.load(model)
    for node in other.graph.node:
        if node.op_type == "Relu":
            node.op_type = "Tanh"
    path = tmp_path / "tanh.onnx"
    onnx.save(other, path)
    sensor, channels = OnnxSensor(path), drive(40)
    assert not sensor.streaming
    np.testing.assert_allclose(
        by_steps(sensor, channels), by_windows(path, channels), rtol=0, atol=1e-6
    )
    estimates = sensor.apply(channels, NO_COMMANDS)
    assert np.nanmax(np.abs(estimates - by_torch(network, channels))) > 1e-3
    with pytest.raises(SensorError, match="Tanh"):
        export_streaming(path, tmp_path / "streaming.onnx")
    assert not (tmp_path / "streaming.onnx").exists()


def test_a_network_with_carried_state_has_no_form_of_its_own() -> None:
    with pytest.raises(SensorError, match="only a windowed network"):
        streaming_model(read_network(MODELS / "carried_ideal.onnx"))
    with pytest.raises(SensorError, match="carries a state"):
        OnnxSensor(MODELS / "carried_ideal.onnx")


def test_the_run_time_needs_neither_torch_nor_the_package_onnx() -> None:
    program = (
        "import sys; from sensor.estimators import make; make('bilstm_w19', 'ideal');"
        "print([name for name in ('torch', 'onnx') if name in sys.modules])"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert ended.stdout.strip() == "[]"


def test_the_metadata_go_with_the_streaming_form(small: tuple[BiLstmNetwork, Path]) -> None:
    session = session_of(streaming_model(read_network(small[1])))
    metadata = json.loads(session.get_modelmeta().custom_metadata_map["sensor"])
    assert metadata == OnnxSensor(small[1]).info.metadata | {"form": "streaming"}
