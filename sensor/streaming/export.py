"""The streaming form of a network as a file of its own, for other tools.

Ours need none: `sensor.runtime` makes it of the windowed file when it opens that.
"""

from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNELS
from sensor.errors import SensorError
from sensor.features import WHEEL_SPEEDS
from sensor.packed import read_network
from sensor.packed.network import PackedNetwork
from sensor.residual_matrices import ResidualMatrices
from sensor.runtime import open_session, session_of
from sensor.streaming.form import StreamingForm
from sensor.streaming.graph import streaming_model

TOLERANCE: Final = 1e-5  # m/s
_WINDOWS: Final = 200


def export_streaming(model: Path, path: Path) -> None:
    """Write the streaming form of the windowed ONNX network `model` to `path`.

    Raises SensorError, and writes nothing, if the file is none that this project trains, or if both
    forms differ by more than 1e-5 m/s.
    """
    content = verified(model)
    temporary = path.with_suffix(".part")
    temporary.write_bytes(content)
    temporary.replace(path)


def verified(model: Path) -> bytes:
    """Return the streaming form of a windowed ONNX network, which was run beside it.

    Raises SensorError as `export_streaming` does.
    """
    network = read_network(model)
    content = streaming_model(network)
    samples = _samples(network)
    form = StreamingForm(session_of(content))
    streamed = np.array([form.output[0].copy() for sample in samples if form.take(sample)])
    windows = np.lib.stride_tricks.sliding_window_view(samples, network.window, axis=0)
    session = open_session(model)
    name = session.get_inputs()[0].name
    whole = [session.run(None, {name: w.T[np.newaxis].copy()})[0][0] for w in windows]
    difference = float(np.abs(streamed - np.array(whole)).max())
    if not difference <= TOLERANCE:
        raise SensorError(
            f"{model}: its streaming form is {difference:.3g} m/s off (limit {TOLERANCE:g})."
        )
    return content


def _samples(network: PackedNetwork) -> npt.NDArray[np.float32]:
    """Draw a run (samples, 14) of the training data's spread, in SI units."""
    noise = np.random.default_rng(0).normal(size=(network.window + _WINDOWS - 1, len(CHANNELS)))
    samples = noise * network.arrays["input_std"] + network.arrays["input_mean"]
    if network.residual:  # mean and deviation there are those of residuals
        samples[:, WHEEL_SPEEDS] += ResidualMatrices.of().driven(samples)
    return samples.astype(np.float32)
