"""The sensor at run time: one sample in, four suspension velocities out, by ONNX Runtime on one
thread.
"""

from pathlib import Path

import numpy as np
import numpy.typing as npt
import onnxruntime as ort

from sensor.channels import CHANNELS, OUTPUTS
from sensor.errors import SensorError
from sensor.metadata import METADATA_KEY, ModelInfo, read_metadata
from sensor.window import Window

__all__ = ["ModelInfo", "OnnxSensor", "SensorError"]

BATCH = 1024


class OnnxSensor:
    """A trained network as a streaming sensor.

    `estimate` (4,) [m/s], positive in extension, order FL FR RL RR, is the same array at every
    step: NaN until the window is full, then the newest estimate. Everything is allocated here,
    nothing in `step` beyond what ONNX Runtime itself does.
    """

    def __init__(self, model: str | Path) -> None:
        """Open the file; raises SensorError if it is no network or its channels, units or rate are
        not this sensor's.
        """
        self._session = open_session(Path(model))
        self.info = read_info(self._session, str(model))
        _check_window(self._session, self.info, str(model))
        self._window = Window(self.info.window)
        self._output = np.zeros((1, len(OUTPUTS)), dtype=np.float32)
        self._binding = self._bind()
        self.estimate = np.full(len(OUTPUTS), np.nan)
        self.deviation = np.full(len(OUTPUTS), np.nan)

    def reset(self) -> None:
        """Forget all samples; the estimate is NaN until the window is full again."""
        self._window.reset()
        self.estimate.fill(np.nan)

    def step(self, measured: npt.NDArray[np.float64], command: npt.NDArray[np.float64]) -> bool:
        """Take one sample (14,) in SI units, update `estimate`; return whether it is valid. The
        network has no input for `command` (4,).

        Raises SensorError naming the channel if the sample holds a NaN or infinity; such a sample
        is not taken.
        """
        if not self._window.push(measured):
            return False
        self._session.run_with_iobinding(self._binding)
        self.estimate[:] = self._output[0]
        return True

    def apply(
        self, channels: npt.NDArray[np.float64], commands: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.float64]:
        """Estimate a whole run: (samples, 14) -> (samples, 4) [m/s], the first window - 1 rows NaN;
        `step`'s state is untouched.
        """
        result = np.full((len(channels), len(OUTPUTS)), np.nan)
        if len(channels) < self.info.window:
            return result
        samples = np.ascontiguousarray(channels, dtype=np.float32)
        windows = np.lib.stride_tricks.sliding_window_view(
            samples, self.info.window, axis=0
        ).transpose(0, 2, 1)
        first = self.info.window - 1
        for start in range(0, len(windows), BATCH):
            batch = np.ascontiguousarray(windows[start : start + BATCH])
            estimate = self._session.run(None, {self._session.get_inputs()[0].name: batch})[0]
            result[first + start : first + start + len(batch)] = np.asarray(estimate)
        return result

    def _bind(self) -> ort.IOBinding:
        """Tie the network's input and output to our two arrays, whose memory never moves."""
        binding = self._session.io_binding()
        for bind, node, array in (
            (binding.bind_input, self._session.get_inputs()[0], self._window.values[np.newaxis]),
            (binding.bind_output, self._session.get_outputs()[0], self._output),
        ):
            bind(node.name, "cpu", 0, np.float32, array.shape, array.ctypes.data)
        return binding


def open_session(path: Path) -> ort.InferenceSession:
    """Open a network file on one thread; raises SensorError if it is none."""
    if not path.is_file():
        raise SensorError(f"{path}: there is no such network file.")
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    try:
        return ort.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime's exceptions share no public base class
        raise SensorError(f"{path}: ONNX Runtime cannot read it as a network: {error}") from error


def read_info(session: ort.InferenceSession, source: str) -> ModelInfo:
    """Read and check a network's metadata; raises SensorError naming everything that differs from
    this sensor's channels.
    """
    return read_metadata(session.get_modelmeta().custom_metadata_map.get(METADATA_KEY), source)


def _check_window(session: ort.InferenceSession, info: ModelInfo, source: str) -> None:
    if info.kind != "windowed":
        raise SensorError(f"{source}: it carries a state, where a windowed network belongs.")
    shape = session.get_inputs()[0].shape
    if list(shape[1:]) != [info.window, len(CHANNELS)]:
        raise SensorError(
            f"{source}: its input is {shape}, but its metadata say window {info.window}."
        )
