"""The linear filter: four weighted sums of the last W samples of 14 channels.

With channels "residual" the four wheel speeds are replaced by their residuals (`sensor.features`),
which are computed from the sample itself. Weights come from `sensor.baselines.fit`.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.baselines.normal_equations import Features
from sensor.channels import (
    CHANNEL_NAMES,
    CHANNEL_UNITS,
    CHANNELS,
    OUTPUT_NAMES,
    OUTPUT_UNITS,
    OUTPUTS,
    SAMPLE_RATE_HZ,
    check_channels,
)
from sensor.errors import SensorError
from sensor.features import WHEEL_SPEEDS, WheelSpeedResiduals, with_residuals
from sensor.window import Window, check_sample

Array = npt.NDArray[np.float64]
_CHUNK = 4096


class FirFilter:
    """A fitted filter: `weights` (W, 14, 4), oldest sample first, and `bias` (4,) [m/s], from SI
    units to m/s.
    """

    def __init__(
        self,
        weights: Array,
        bias: Array,
        training: dict[str, Any] | None = None,
        channels: Features = "raw",
    ) -> None:
        self.weights, self.bias, self.training = weights, bias, training or {}
        self.window, self.channels = len(weights), channels
        self._flat = np.ascontiguousarray(weights.reshape(-1, len(OUTPUTS)), dtype=np.float64)
        self._buffer = Window(self.window, np.float64)
        self._residuals = WheelSpeedResiduals() if channels == "residual" else None
        self._features = np.zeros(len(CHANNELS))
        self.estimate = np.full(len(OUTPUTS), np.nan)
        self.deviation = np.full(len(OUTPUTS), np.nan)

    def reset(self) -> None:
        """Forget all samples."""
        self._buffer.reset()
        self.estimate.fill(np.nan)

    def step(self, measured: Array, command: Array) -> bool:
        """Take one sample (14,) in SI units, update `estimate`; return whether it is valid.

        Raises SensorError naming a channel that is NaN or infinite; such a sample is not taken.
        """
        check_sample(measured)
        self._features[:] = measured
        if self._residuals is not None:
            self._features[WHEEL_SPEEDS] = self._residuals.step(measured)
        if not self._buffer.push(self._features):
            return False
        np.matmul(self._buffer.values.reshape(-1), self._flat, out=self.estimate)
        self.estimate += self.bias
        return True

    def apply(
        self, channels: npt.NDArray[np.floating[Any]], commands: npt.NDArray[np.floating[Any]]
    ) -> Array:
        """Estimate a whole run: (samples, 14) -> (samples, 4) [m/s], the first W - 1 rows NaN."""
        result = np.full((len(channels), len(OUTPUTS)), np.nan)
        if len(channels) < self.window:
            return result
        features = np.asarray(channels, dtype=np.float64)
        if self.channels == "residual":
            features = with_residuals(features)
        windows = np.lib.stride_tricks.sliding_window_view(features, self.window, axis=0)
        windows = windows.transpose(0, 2, 1)  # (samples - W + 1, W, 14), oldest sample first
        for start in range(0, len(windows), _CHUNK):
            chunk = windows[start : start + _CHUNK].reshape(-1, len(self._flat))
            first = self.window - 1 + start
            result[first : first + len(chunk)] = chunk @ self._flat + self.bias
        return result

    def save(self, path: str | Path) -> None:
        """Write an .npz file, weights in single precision, with the same metadata as a network."""
        about = {
            "window": self.window,
            "channels": self.channels,
            "sample_rate_hz": SAMPLE_RATE_HZ,
            "inputs": {"names": CHANNEL_NAMES, "units": CHANNEL_UNITS},
            "outputs": {"names": OUTPUT_NAMES, "units": OUTPUT_UNITS},
            "training": self.training,
        }
        text = json.dumps(about, sort_keys=True)
        weights, bias = self.weights.astype(np.float32), self.bias.astype(np.float32)
        np.savez_compressed(path, weights=weights, bias=bias, metadata=np.array(text))

    @classmethod
    def load(cls, path: str | Path) -> "FirFilter":
        """Read a filter; raises SensorError if the file is none or its channels, units or rate
        differ from this sensor's.
        """
        try:
            with np.load(path, allow_pickle=False) as content:
                weights = content["weights"].astype(np.float64)
                bias = content["bias"].astype(np.float64)
                about = json.loads(str(content["metadata"]))
            inputs, outputs, rate = about["inputs"], about["outputs"], about["sample_rate_hz"]
            channels, training = about["channels"], about["training"]
        except (OSError, ValueError, KeyError) as error:
            raise SensorError(f"{path}: it cannot be read as a linear filter: {error}") from error
        check_channels(f"{path}, inputs", inputs["names"], inputs["units"], CHANNELS)
        check_channels(f"{path}, outputs", outputs["names"], outputs["units"], OUTPUTS)
        if rate != SAMPLE_RATE_HZ:
            raise SensorError(f"{path}: it expects {rate:g} Hz, where {SAMPLE_RATE_HZ} Hz belongs.")
        return cls(weights, bias, training, channels)
