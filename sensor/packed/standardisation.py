"""Mean and deviation of a network's inputs."""

from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.errors import SensorError


def take_standardisation(
    arrays: dict[str, npt.NDArray[Any]],
    scale: npt.NDArray[np.float64],
    offset: npt.NDArray[np.float64],
) -> None:
    """Put `input_mean` and `input_std` of samples scale * x + offset, (14,) each, into `arrays`.

    Raises SensorError if it holds others, as every sample is standardised alike.
    """
    if not np.all(scale):
        raise SensorError("a channel of its samples is multiplied by zero, which is not supported.")
    taken = {"input_mean": -offset / scale, "input_std": 1.0 / scale}
    for name, value in taken.items():
        rounded = value.astype(np.float32)
        if not np.array_equal(arrays.setdefault(name, rounded), rounded):
            raise SensorError("its samples are not all standardised alike, which is not supported.")
