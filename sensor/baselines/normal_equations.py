"""Least squares over the windows of many runs, from their normal equations.

A window is W samples of 14 features, oldest first; the target is the truth at its last sample. Only
sums over the windows are kept, so the data may be larger than memory, and they are added up without
ever making a window: shifted by one sample, the sums of a run lose one product and gain another.
"""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal
from zlib import crc32

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNELS, OUTPUTS
from sensor.conditions import Condition, Measurement
from sensor.dataset import Run
from sensor.errors import SensorError
from sensor.features import with_residuals

Array = npt.NDArray[np.float64]
Features = Literal["raw", "residual"]
"""What stands in the places of the wheel speeds: the speeds, or their residuals."""


@dataclass(frozen=True)
class Samples:
    """Features (n, 14) and truth (n, 4) [m/s] of each run as measured; can be gone through again.

    Every run has offsets and noise of its own, told by its name; with `repeats` it comes that
    often, each time with others.
    """

    runs: Iterable[Run]
    condition: Condition = "ideal"
    channels: Features = "raw"
    repeats: int = 1

    def __iter__(self) -> Iterator[tuple[Array, Array]]:
        for run in self.runs:
            for repeat in range(1 if self.condition == "ideal" else self.repeats):
                seed = crc32(f"{run.name}/{repeat}".encode())
                measured = Measurement(self.condition, seed).apply(run.channels, run.stage)
                features = with_residuals(measured) if self.channels == "residual" else measured
                yield features, run.truth.astype(np.float64)


@dataclass(frozen=True)
class Standard:
    """Mean and standard deviation of the features (14,) and of the truth (4,); never zero."""

    input_mean: Array
    input_std: Array
    output_mean: Array
    output_std: Array

    @classmethod
    def of(cls, samples: Iterable[tuple[Array, Array]]) -> "Standard":
        """Take the figures over all samples; raises SensorError if there is none."""
        count, width = 0, len(CHANNELS) + len(OUTPUTS)
        total, square = np.zeros(width), np.zeros(width)
        for pair in samples:
            values = np.hstack(pair)
            count += len(values)
            total += values.sum(axis=0)
            square += np.square(values).sum(axis=0)
        if not count:
            raise SensorError("there is no run to take mean and deviation from.")
        mean = total / count
        std: Array = np.sqrt(np.maximum(square / count - mean**2, 0.0))
        std[std < 1e-9] = 1.0  # a channel that never moves must not divide by zero
        n = len(CHANNELS)
        return cls(mean[:n], std[:n], mean[n:], std[n:])


@dataclass(frozen=True)
class NormalEquations:
    """Sums over all windows, standardised, constant last: `gram` (p, p), `moment` (p, 4), `square`
    (4,) of the truth, with p = W * 14 + 1, and `count` windows; each counts by its run's weight.
    """

    window: int
    standard: Standard
    gram: Array
    moment: Array
    square: Array
    count: float

    @classmethod
    def of(
        cls,
        samples: Iterable[tuple[Array, Array]],
        window: int,
        standard: Standard,
        floor: float | None = None,
    ) -> "NormalEquations":
        """Accumulate over runs, each weighted by 1 / (rms(truth)^2 + `floor`^2) [s2/m2] so that
        quiet runs count too, or all alike without; raises SensorError if none is as long as the
        window.
        """
        size = window * len(CHANNELS) + 1
        gram, moment = np.zeros((size, size)), np.zeros((size, len(OUTPUTS)))
        square, count = np.zeros(len(OUTPUTS)), 0.0
        for features, truth in samples:
            windows = len(features) - window + 1
            if windows < 1:
                continue
            x = (features - standard.input_mean) / standard.input_std
            y = ((truth - standard.output_mean) / standard.output_std)[window - 1 :]
            mean_square = float(np.mean(np.square(truth)))
            weight = 1.0 if floor is None else 1.0 / (mean_square + floor**2)
            lagged = [x[lag : lag + windows] for lag in range(window)]
            sums = weight * np.concatenate([part.sum(axis=0) for part in lagged])
            gram[:-1, :-1] += weight * _gram(x, window)
            gram[:-1, -1] += sums
            gram[-1, :-1] += sums
            gram[-1, -1] += weight * windows
            moment[:-1] += weight * np.concatenate([part.T @ y for part in lagged])
            moment[-1] += weight * y.sum(axis=0)
            square += weight * np.square(y).sum(axis=0)
            count += weight * windows
        if count == 0.0:
            raise SensorError(f"no run is as long as the filter's window of {window} samples.")
        return cls(window, standard, gram, moment, square, count)

    def without(self, channels: Collection[int]) -> "NormalEquations":
        """Return the equations of a filter that is not given these channels (their places): all
        their products are zero, and so become their weights.
        """
        gone = np.zeros((self.window, len(CHANNELS)), dtype=np.bool_)
        gone[:, list(channels)] = True
        dropped = np.append(gone.reshape(-1), False)
        gram, moment = self.gram.copy(), self.moment.copy()
        gram[dropped], gram[:, dropped], moment[dropped] = 0.0, 0.0, 0.0
        return replace(self, gram=gram, moment=moment)

    def solve(self, ridge: float) -> Array:
        """Return the weights (p, 4) that minimise mean square error + ridge * |weights|^2, all
        standardised; the constant is free.
        """
        penalty = np.full(len(self.gram), ridge * self.count)
        penalty[-1] = 0.0
        return np.asarray(
            np.linalg.solve(self.gram + np.diag(penalty), self.moment), dtype=np.float64
        )

    def rmse(self, weights: Array) -> Array:
        """Return the root mean square error (4,) [m/s] of weights (p, 4) on these windows."""
        explained = 2.0 * np.sum(weights * self.moment, axis=0)
        predicted = np.sum(weights * (self.gram @ weights), axis=0)
        mean_square = np.maximum(self.square - explained + predicted, 0.0) / self.count
        return np.asarray(np.sqrt(mean_square) * self.standard.output_std)


def _gram(x: Array, window: int) -> Array:
    """Return the sum over all windows of x (n, channels) of window times window, (p - 1, p - 1)."""
    windows, width = len(x) - window + 1, x.shape[1]
    blocks = np.zeros((window, width, window, width))
    for lag in range(window):
        blocks[0, :, lag] = x[:windows].T @ x[lag : lag + windows]
    before, behind = x[:window], x[windows:]
    for i in range(1, window):
        rest = window - i
        blocks[i, :, i:] = blocks[i - 1, :, i - 1 : -1]
        blocks[i, :, i:] -= np.einsum("a,jb->ajb", before[i - 1], before[i - 1 : i - 1 + rest])
        blocks[i, :, i:] += np.einsum("a,jb->ajb", behind[i - 1], behind[i - 1 : i - 1 + rest])
    gram = blocks.reshape(window * width, window * width)
    upper = np.triu(gram)
    return upper + np.triu(gram, 1).T
