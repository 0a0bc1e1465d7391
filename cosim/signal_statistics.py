"""One number made of a signal in a window of time."""

from __future__ import annotations

from typing import Final, Literal, get_args

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Statistic = Literal["each", "mean", "rms", "std", "peak", "final"]
STATISTICS: Final = get_args(Statistic)


def statistic(name: Statistic, values: Array) -> tuple[float, int | None]:
    """Return a statistic, other than `each`, of the samples (n,), n > 0, and which sample it is, if
    it is one.

    `rms` is about zero and `std` about the mean, of all samples; `peak` is the sample farthest from
    zero, without its sign.
    """
    if name == "final":
        return float(values[-1]), len(values) - 1
    if name == "peak":
        at = int(np.argmax(np.abs(values)))
        return float(abs(values[at])), at
    centred = values - np.mean(values) if name == "std" else values
    if name == "mean":
        return float(np.mean(values)), None
    return float(np.sqrt(np.mean(np.square(centred)))), None


def worst(values: Array, low: float | None, high: float | None) -> int:
    """Return which of the samples (n,), n > 0, is farthest beyond its bounds, or nearest to one."""
    beyond = np.full(len(values), -np.inf)
    if high is not None:
        beyond = np.maximum(beyond, values - high)
    if low is not None:
        beyond = np.maximum(beyond, low - values)
    return int(np.argmax(beyond))
