"""The last W samples as one contiguous array, kept up to date without allocating."""

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNEL_NAMES
from sensor.errors import SensorError

_LARGEST = float(np.finfo(np.float32).max)


class Window:
    """The newest `length` samples, oldest first: `values` (length, 14) never moves in memory."""

    def __init__(self, length: int, dtype: npt.DTypeLike = np.float32) -> None:
        self.values = np.zeros((length, len(CHANNEL_NAMES)), dtype=dtype)
        self._flat = self.values.reshape(-1)
        self._magnitude = np.zeros(len(CHANNEL_NAMES))
        self._fits = np.zeros(len(CHANNEL_NAMES), dtype=np.bool_)
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
        """Append one sample (14,) in SI units, drop the oldest; return `full`.

        Raises SensorError, leaving the window as it was, if the sample is of another shape or holds
        a NaN or infinity.
        """
        check_sample(measured, self._magnitude, self._fits)
        # One-dimensional and towards lower addresses: numpy then needs no temporary copy.
        self._flat[: -len(CHANNEL_NAMES)] = self._flat[len(CHANNEL_NAMES) :]
        self.values[-1] = measured
        self._count += 1
        return self.full


def check_sample(
    measured: npt.NDArray[np.float64],
    magnitude: npt.NDArray[np.float64],
    fits: npt.NDArray[np.bool_],
) -> None:
    """Raise SensorError naming every channel of `measured` (14,) that is NaN or infinite; the other
    two are work space.
    """
    if measured.shape != (len(CHANNEL_NAMES),):
        raise SensorError(
            f"a sample has shape {measured.shape}, where ({len(CHANNEL_NAMES)},) belongs."
        )
    np.abs(measured, out=magnitude)
    np.less_equal(magnitude, _LARGEST, out=fits)  # false for NaN too
    if not fits.all():
        bad = [f"{name} is {measured[i]}" for i, name in enumerate(CHANNEL_NAMES) if not fits[i]]
        raise SensorError(f"the sample cannot be used: {', '.join(bad)}.")
