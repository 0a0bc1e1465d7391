"""A windowed network at run time: one sample in, four suspension velocities out, by ONNX Runtime on
one thread.
"""

import json
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import onnxruntime as ort

from sensor.channels import CHANNELS, OUTPUTS
from sensor.errors import SensorError
from sensor.metadata import METADATA_KEY, ModelInfo, read_metadata
from sensor.packed import read_network
from sensor.streaming.form import StreamingForm
from sensor.streaming.graph import STREAMING, streaming_model
from sensor.window import check_sample
from sensor.windowed import WindowedForm

__all__ = ["ModelInfo", "OnnxSensor", "SensorError"]

Array = npt.NDArray[np.float64]


class Form(Protocol):
    """What runs the network sample by sample."""

    output: npt.NDArray[np.float32]

    def fresh(self) -> "Form":
        """Return the same network before its first sample."""

    def reset(self) -> None:
        """Forget all samples."""

    def take(self, measured: Array) -> bool:
        """Take one sample (14,); return whether `output` (1, 4) [m/s] counts."""


class OnnxSensor:
    """A trained network as a streaming sensor.

    `estimate` (4,) [m/s], positive in extension, order FL FR RL RR, is the same array at every
    step: NaN until the window is full, then the newest estimate. Everything is allocated here,
    nothing in `step` beyond what ONNX Runtime itself does.

    A file of a structure that this project trains runs in its streaming form, and `streaming` is
    true; any other runs as it is, the whole window at every sample.
    """

    def __init__(self, model: str | Path) -> None:
        """Open the file; raises SensorError if it is no network or its channels, units or rate are
        not this sensor's.
        """
        self.info, self._form = _opened(Path(model))
        self.streaming = isinstance(self._form, StreamingForm)
        self.estimate = np.full(len(OUTPUTS), np.nan)
        self.deviation = np.full(len(OUTPUTS), np.nan)

    def reset(self) -> None:
        """Forget all samples; the estimate is NaN until the window is full again."""
        self._form.reset()
        self.estimate.fill(np.nan)

    def step(self, measured: Array, command: Array) -> bool:
        """Take one sample (14,) in SI units, update `estimate`; return whether it is valid. The
        network has no input for `command` (4,).

        Raises SensorError naming the channel if the sample holds a NaN or infinity; such a sample
        is not taken.
        """
        check_sample(measured)
        if not self._form.take(measured):
            return False
        self.estimate[:] = self._form.output[0]
        return True

    def apply(self, channels: npt.NDArray[np.floating[Any]], commands: Array) -> Array:
        """Estimate a whole run: (samples, 14) -> (samples, 4) [m/s], the first window - 1 rows NaN,
        and those whose window holds a NaN; `step`'s state is untouched.
        """
        result = np.full((len(channels), len(OUTPUTS)), np.nan)
        form = self._form.fresh()
        for row, sample in zip(result, channels, strict=True):
            if form.take(sample):
                row[:] = form.output[0]
        return result


def open_session(path: Path) -> ort.InferenceSession:
    """Open a network file on one thread; raises SensorError if it is none."""
    if not path.is_file():
        raise SensorError(f"{path}: there is no such network file.")
    try:
        return session_of(str(path))
    except Exception as error:  # ONNX Runtime's exceptions share no public base class
        raise SensorError(f"{path}: ONNX Runtime cannot read it as a network: {error}") from error


def session_of(model: str | bytes) -> ort.InferenceSession:
    """Return a session on one thread of a file or of its content."""
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4  # what is wrong is in its exceptions too
    return ort.InferenceSession(model, options, providers=["CPUExecutionProvider"])


def read_info(session: ort.InferenceSession, source: str) -> ModelInfo:
    """Read and check a network's metadata; raises SensorError naming everything that differs from
    this sensor's channels.
    """
    return read_metadata(session.get_modelmeta().custom_metadata_map.get(METADATA_KEY), source)


def _opened(path: Path) -> tuple[ModelInfo, Form]:
    """Return what the file says of itself and what runs it."""
    try:
        network = read_network(path)
    except SensorError:  # another structure, or no network at all: then this fails too
        session = open_session(path)
        info = read_info(session, str(path))
        _check_window(session, info, str(path))
        return info, WindowedForm(session, info.window)
    info = read_metadata(json.dumps(dict(network.metadata)), str(path))
    _check_kind(info, str(path))
    return info, StreamingForm(session_of(streaming_model(network)))


def _check_window(session: ort.InferenceSession, info: ModelInfo, source: str) -> None:
    _check_kind(info, source)
    if info.metadata.get("form") == STREAMING:
        raise SensorError(
            f"{source}: it is the streaming form of a network for other tools; give the windowed "
            "file that it was made of."
        )
    shape = session.get_inputs()[0].shape
    if list(shape[1:]) != [info.window, len(CHANNELS)]:
        raise SensorError(
            f"{source}: its input is {shape}, but its metadata say window {info.window}."
        )


def _check_kind(info: ModelInfo, source: str) -> None:
    if info.kind != "windowed":
        raise SensorError(f"{source}: it carries a state, where a windowed network belongs.")
