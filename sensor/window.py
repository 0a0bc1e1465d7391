"""The last W samples as one contiguous array, kept up to date without allocating."""

from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNEL_NAMES
from sensor.errors import SensorError

_LARGEST: Final = float(np.finfo(np.float32).max)
_LARGEST_SQUARE: Final = _LARGEST**2


class Window:
    """The newest `length` samples, oldest first: `values` (length, 14) never moves in memory."""

    def __init__(self, length: int, dtype: npt.DTypeLike = np.float32) -> None:
        self.values = np.zeros((length, len(CHANNEL_NAMES)), dtype=dtype)
        self._flat = self.values.reshape(-1)
        self._count = 0

    @property
    def full(self) -> bool:
        """Whether `length` samples have been pushed since the last reset."""
        return self._count >= len(self.values)

    def reset(self) -> None:
        """Forget all samples."""
        self._count = 0
        self.values.fill(0.0)

    def push(self, measured: npt.NDArray[np.float64]) -> bool:
        """Append one sample (14,) in SI units, drop the oldest; return `full`."""
        # One-dimensional and towards lower addresses: numpy then needs no temporary copy.
        self._flat[: -len(CHANNEL_NAMES)] = self._flat[len(CHANNEL_NAMES) :]
        self.values[-1] = measured
        self._count += 1
        return self.full


def check_sample(measured: npt.NDArray[np.float64]) -> None:
    """Raise SensorError if `measured` is of another shape than (14,), or naming every channel that
    is NaN, infinite or beyond single precision.
    """
    if measured.shape != (len(CHANNEL_NAMES),):
        raise SensorError(
            f"a sample has shape {measured.shape}, where ({len(CHANNEL_NAMES)},) belongs."
        )
    if measured.dot(measured) <= _LARGEST_SQUARE:  # one call for all; false for NaN too
        return
    fits = np.abs(measured) <= _LARGEST
    if not fits.all():
        bad = [f"{name} is {measured[i]}" for i, name in enumerate(CHANNEL_NAMES) if not fits[i]]
        raise SensorError(f"the sample cannot be used: {', '.join(bad)}.")
