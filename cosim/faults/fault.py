"""What every fault is to the stack: one that changes the channels of a sample in their place."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNELS

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


class Fault(Protocol):
    """A fault. It is shown every sample from the first on, since some keep what was before."""

    def step(self, k: int, channels: Array) -> None:
        """Change the channels (14,) of sample k, SI units; leave them alone outside the window."""


def mask_of(places: Iterable[int]) -> Mask:
    """Return the channels at these places as a mask (14,)."""
    mask = np.zeros(len(CHANNELS), dtype=np.bool_)
    mask[list(places)] = True
    return mask


def zeros() -> Array:
    """Return room for the channels of one sample, (14,)."""
    return np.zeros(len(CHANNELS))
