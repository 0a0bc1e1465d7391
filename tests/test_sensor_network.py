"""One network, four times: torch's own bidirectional LSTM, ours, ONNX Runtime over windows, ONNX
Runtime streaming.
"""

import json
from pathlib import Path

import numpy as np
import numpy.typing as npt
import onnx
import pytest
import torch

from sensor.errors import SensorError
from sensor.export import build_windowed, export_windowed, verify
from sensor.features import WHEEL_SPEEDS, with_residuals
from sensor.network import BiLstmNetwork, NetworkConfig
from sensor.runtime import OnnxSensor

Array = npt.NDArray[np.float64]
SAMPLES: Array = np.random.default_rng(0).normal(size=(60, 14)) * np.logspace(-1, 1, 14) + 2.0
COMMANDS = np.full((len(SAMPLES), 4), 0.3)


def make_network(config: NetworkConfig | None = None) -> BiLstmNetwork:
    torch.manual_seed(0)
    network = BiLstmNetwork(config)
    network.input_mean.fill_(2.0)
    network.input_std.copy_(torch.logspace(-1, 1, 14))
    network.output_mean.copy_(torch.tensor([0.01, -0.01, 0.02, 0.0]))
    network.output_std.fill_(0.2)
    return network.eval()


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "net.onnx"
    return export_windowed(make_network(), path, training={"recipe": "none"})


def test_equals_torchs_bidirectional_lstm_at_the_last_sample() -> None:
    network = make_network()
    lstm = torch.nn.LSTM(14, 167, batch_first=True, bidirectional=True)
    network.load_bidirectional(lstm)
    windows = torch.randn(50, 19, 14)
    with torch.no_grad():
        expected = lstm(windows)[0][:, -1]
        assert (network.features(windows) - expected).abs().max() < 1e-6
        assert (network.features(windows) - lstm(windows)[0][:, 0]).abs().max() > 0.1


def test_parameters_are_the_papers() -> None:
    network = make_network()
    config = network.config
    assert (config.window, config.units, config.hidden, config.dropout) == (19, 167, 256, 0.5)
    assert network.dense.in_features == 334


def test_onnx_equals_torch(model: Path) -> None:
    network, onnx_sensor = make_network(), OnnxSensor(model)
    windows = np.lib.stride_tricks.sliding_window_view(SAMPLES, 19, axis=0).transpose(0, 2, 1)
    with torch.no_grad():
        expected = network(torch.tensor(windows.copy(), dtype=torch.float32)).numpy()
    estimates = onnx_sensor.apply(SAMPLES, COMMANDS)
    np.testing.assert_allclose(estimates[18:], expected, rtol=0.0, atol=1e-5)
    assert np.isnan(estimates[:18]).all()
    assert np.isnan(onnx_sensor.apply(SAMPLES[:18], COMMANDS[:18])).all()


def test_streaming_is_invalid_until_the_window_is_full_and_equals_batch(model: Path) -> None:
    onnx_sensor = OnnxSensor(model)
    expected, estimate = onnx_sensor.apply(SAMPLES, COMMANDS), onnx_sensor.estimate
    for _ in range(2):
        for k, sample in enumerate(SAMPLES):
            assert onnx_sensor.step(sample, COMMANDS[0]) is (k >= 18)
            np.testing.assert_allclose(estimate, expected[k], rtol=0.0, atol=1e-6)
        onnx_sensor.reset()
        assert np.isnan(estimate).all()
    assert onnx_sensor.estimate is estimate


def test_bad_samples_are_named_and_not_taken(model: Path) -> None:
    onnx_sensor = OnnxSensor(model)
    expected = onnx_sensor.apply(SAMPLES, COMMANDS)
    for k, sample in enumerate(SAMPLES):
        onnx_sensor.step(sample, COMMANDS[0])
        bad = sample.copy()
        bad[2], bad[13] = np.nan, np.inf
        with pytest.raises(SensorError, match=r"Car\.az is nan, Steer\.WhlAng is inf"):
            onnx_sensor.step(bad, COMMANDS[0])
        np.testing.assert_allclose(onnx_sensor.estimate, expected[k], rtol=0.0, atol=1e-6)
    with pytest.raises(SensorError, match=r"\(13,\)"):
        onnx_sensor.step(SAMPLES[0, :13], COMMANDS[0])


def edited(model: Path, path: Path, old: str, new: str) -> Path:
    network = onnx.load(model)
    prop = network.metadata_props[0]
    assert old in prop.value
    prop.value = prop.value.replace(old, new)
    onnx.save(network, path)
    return path


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"Car.vx"', '"Car.v"', r"channel 7 is 'Car\.v', where 'Car\.vx' belongs"),
        ('"m/s2"', '"g"', r"'Car\.ax' is in 'g', where 'm/s2' belongs"),
        ('"VRel.RL"', '"VRel.LR"', r"outputs: channel 3 is 'VRel\.LR'"),
        ('"sample_rate_hz": 100', '"sample_rate_hz": 50', "expects 50 Hz, where 100 Hz"),
        ('"window": 19', '"window": 21', "window 21"),
        ('"inputs"', '"input"', "lacks or misspells 'inputs'"),
    ],
)
def test_foreign_networks_are_refused(
    model: Path, tmp_path: Path, old: str, new: str, message: str
) -> None:
    with pytest.raises(SensorError, match=message):
        OnnxSensor(edited(model, tmp_path / "net.onnx", old, new))


def test_files_that_are_no_network_are_refused(model: Path, tmp_path: Path) -> None:
    with pytest.raises(SensorError, match="no such network file"):
        OnnxSensor(tmp_path / "none.onnx")
    (tmp_path / "text.onnx").write_text("hello")
    with pytest.raises(SensorError, match="cannot read it"):
        OnnxSensor(tmp_path / "text.onnx")
    network = onnx.load(model)
    del network.metadata_props[:]
    onnx.save(network, tmp_path / "bare.onnx")
    with pytest.raises(SensorError, match="no entry 'sensor'"):
        OnnxSensor(tmp_path / "bare.onnx")


def test_metadata_tell_what_the_network_is(model: Path) -> None:
    about = OnnxSensor(model).info.metadata
    assert about["training"] == {"recipe": "none"}
    assert about["network"] == {"units": 167, "hidden": 256}
    assert "last sample" in about["tap"]
    np.testing.assert_allclose(about["inputs"]["mean"], 2.0)
    np.testing.assert_allclose(about["outputs"]["std"], 0.2)
    assert json.loads(json.dumps(about, allow_nan=False)) == about


def test_a_wrong_graph_is_never_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    network = make_network(NetworkConfig(window=4, units=5, hidden=6))
    assert verify(build_windowed(network), network) <= 1e-5
    monkeypatch.setattr("sensor.export._TORCH_TO_ONNX_GATES", [0, 1, 2, 3])
    with pytest.raises(SensorError, match="not written"):
        export_windowed(network, tmp_path / "net.onnx")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("units", [13, 16])
def test_bfloat16_gives_the_same_output_and_gradients_to_its_precision(units: int) -> None:
    network = make_network(NetworkConfig(window=7, units=units, hidden=32, dropout=0.0))
    windows = torch.randn(64, 7, 14)

    def gradients(bf16: bool) -> dict[str, torch.Tensor]:
        network.zero_grad()
        with torch.autocast("cpu", torch.bfloat16, enabled=bf16):
            estimate = network.standardised(windows)
        estimate.float().square().mean().backward()
        return {
            name: p.grad.clone() for name, p in network.named_parameters() if p.grad is not None
        }

    exact, rounded = gradients(False), gradients(True)
    assert len(exact) == 10
    for name, gradient in exact.items():
        assert (rounded[name] - gradient).norm() < 0.03 * gradient.norm(), name


def test_residual_network_takes_the_residuals_of_what_is_measured(tmp_path: Path) -> None:
    network = make_network(NetworkConfig(residual=True))
    network.input_mean.fill_(0.0)
    network.input_std.fill_(0.1)
    rng = np.random.default_rng(2)
    samples = rng.normal(size=(60, 14)) * 0.3
    samples[:, 6] += 30.0
    samples[:, WHEEL_SPEEDS] = samples[:, [6]] + rng.normal(size=(60, 4)) * 0.2  # some clipped
    measured = samples.astype(np.float32).astype(np.float64)
    windows = np.lib.stride_tricks.sliding_window_view(
        with_residuals(measured).astype(np.float32), 19, axis=0
    ).transpose(0, 2, 1)
    with torch.no_grad():
        standardised = (torch.from_numpy(windows.copy()) - network.input_mean) / network.input_std
        expected = network.standardised(standardised) * network.output_std + network.output_mean
    path = export_windowed(network, tmp_path / "residual.onnx")
    estimates = OnnxSensor(path).apply(measured, np.zeros((60, 4)))
    np.testing.assert_allclose(estimates[18:], expected.numpy(), rtol=0.0, atol=1e-5)
    raw = make_network()
    raw.load_state_dict(network.state_dict())
    other = OnnxSensor(export_windowed(raw, tmp_path / "raw.onnx")).apply(
        measured, np.zeros((60, 4))
    )
    assert np.abs(other - estimates)[18:].max() > 0.01
