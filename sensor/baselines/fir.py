"""The linear filter over the same window: four weighted sums of W samples x 14 channels, fitted by
ridge regression.

Channels are standardised first, so that one ridge fits all. The normal equations (W*14+1 unknowns)
are accumulated run by run in double precision; only the sums are kept, so the data set may be
larger than memory.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

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
from sensor.dataset import Normalisation, Run
from sensor.errors import SensorError
from sensor.window import Window

Array = npt.NDArray[np.float64]
_CHUNK = 4096


@dataclass(frozen=True)
class NormalEquations:
    """Sums over all windows, standardised, bias last: `gram` (p, p), `moment` (p, 4), p = W*14+1;
    `count` windows.
    """

    window: int
    normalisation: Normalisation
    gram: Array
    moment: Array
    count: int

    @classmethod
    def of(
        cls, runs: Iterable[Run], window: int, normalisation: Normalisation
    ) -> "NormalEquations":
        """Accumulate over runs; raises SensorError if none is as long as the window."""
        size = window * len(CHANNELS) + 1
        gram, moment, count = np.zeros((size, size)), np.zeros((size, len(OUTPUTS))), 0
        n = normalisation
        for run in runs:
            if len(run.channels) < window:
                continue
            samples = (run.channels.astype(np.float64) - n.input_mean) / n.input_std
            truth = (run.truth.astype(np.float64) - n.output_mean) / n.output_std
            windows = _windows(samples, window)
            for start in range(0, len(windows), _CHUNK):
                chunk = windows[start : start + _CHUNK]
                features = np.ones((len(chunk), size))
                features[:, :-1] = chunk.reshape(len(chunk), -1)
                first = window - 1 + start
                gram += features.T @ features
                moment += features.T @ truth[first : first + len(chunk)]
                count += len(chunk)
        if count == 0:
            raise SensorError(f"no run is as long as the filter's window of {window} samples.")
        return cls(window, normalisation, gram, moment, count)

    def solve(self, ridge: float) -> "FirFilter":
        """Minimise mean square error + ridge * |weights|^2, all standardised; the bias is free."""
        penalty = np.full(len(self.gram), ridge * self.count)
        penalty[-1] = 0.0
        solution = np.linalg.solve(self.gram + np.diag(penalty), self.moment)
        n = self.normalisation
        # Into physical units: the standardisation becomes part of weights and bias.
        weights = solution[:-1].reshape(self.window, len(CHANNELS), len(OUTPUTS))
        weights = weights * n.output_std / n.input_std[:, np.newaxis].astype(np.float64)
        bias = solution[-1] * n.output_std + n.output_mean
        bias = bias - np.einsum("wco,c->o", weights, n.input_mean.astype(np.float64))
        return FirFilter(weights, bias, {"ridge": ridge, "windows": self.count})


class FirFilter:
    """A fitted filter: `weights` (W, 14, 4), oldest sample first, and `bias` (4,) [m/s], from SI
    units to m/s.
    """

    def __init__(self, weights: Array, bias: Array, training: dict[str, Any] | None = None) -> None:
        self.weights, self.bias, self.training = weights, bias, training or {}
        self.window = len(weights)
        self._flat = np.ascontiguousarray(weights.reshape(-1, len(OUTPUTS)))
        self._buffer = Window(self.window, np.float64)
        self.estimate = np.full(len(OUTPUTS), np.nan)
        self.deviation = np.full(len(OUTPUTS), np.nan)

    @classmethod
    def fit(cls, runs: Sequence[Run], window: int = 19, ridge: float = 1e-6) -> "FirFilter":
        """Fit on runs; raises SensorError if none is as long as the window."""
        return NormalEquations.of(runs, window, Normalisation.of(runs)).solve(ridge)

    def reset(self) -> None:
        """Forget all samples."""
        self._buffer.reset()
        self.estimate.fill(np.nan)

    def step(self, measured: Array, command: Array) -> bool:
        """Take one sample (14,) in SI units, update `estimate`; return whether it is valid."""
        if not self._buffer.push(measured):
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
        windows = _windows(np.asarray(channels, dtype=np.float64), self.window)
        for start in range(0, len(windows), _CHUNK):
            chunk = windows[start : start + _CHUNK]
            first = self.window - 1 + start
            result[first : first + len(chunk)] = (
                chunk.reshape(len(chunk), -1) @ self._flat + self.bias
            )
        return result

    def save(self, path: str | Path) -> None:
        """Write an .npz file with the same metadata as a network."""
        about = {
            "window": self.window,
            "sample_rate_hz": SAMPLE_RATE_HZ,
            "inputs": {"names": CHANNEL_NAMES, "units": CHANNEL_UNITS},
            "outputs": {"names": OUTPUT_NAMES, "units": OUTPUT_UNITS},
            "training": self.training,
        }
        text = json.dumps(about, sort_keys=True)
        np.savez(path, weights=self.weights, bias=self.bias, metadata=np.array(text))

    @classmethod
    def load(cls, path: str | Path) -> "FirFilter":
        """Read a filter; raises SensorError if the file is none or its channels, units or rate
        differ from this sensor's.
        """
        try:
            with np.load(path, allow_pickle=False) as content:
                weights, bias = content["weights"], content["bias"]
                about = json.loads(str(content["metadata"]))
            inputs, outputs, rate = about["inputs"], about["outputs"], about["sample_rate_hz"]
        except (OSError, ValueError, KeyError) as error:
            raise SensorError(f"{path}: it cannot be read as a linear filter: {error}") from error
        check_channels(f"{path}, inputs", inputs["names"], inputs["units"], CHANNELS)
        check_channels(f"{path}, outputs", outputs["names"], outputs["units"], OUTPUTS)
        if rate != SAMPLE_RATE_HZ:
            raise SensorError(f"{path}: it expects {rate:g} Hz, where {SAMPLE_RATE_HZ} Hz belongs.")
        return cls(weights, bias, about["training"])


def _windows(samples: Array, window: int) -> Array:
    """View samples (n, 14) as windows (n - W + 1, W, 14), oldest sample first."""
    return np.lib.stride_tricks.sliding_window_view(samples, window, axis=0).transpose(0, 2, 1)
