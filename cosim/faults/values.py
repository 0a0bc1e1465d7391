"""Faults of the values: each channel is changed by itself, from what it is at the sample.

`np.add(..., where=mask)` and its like leave the other channels' bits alone and need no copy.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from cosim.faults.fault import Array, Mask, zeros
from cosim.faults.window import Window
from sensor.channels import SAMPLE_RATE_HZ

_STEP_S: Final = 1 / SAMPLE_RATE_HZ


class Bias:
    """`value` is added, in the channels' unit."""

    def __init__(self, window: Window, mask: Mask, value: float) -> None:
        self._window, self._mask, self._value = window, mask, value

    def step(self, k: int, channels: Array) -> None:
        """Add the offset."""
        weight = self._window.weight(k)
        if weight:
            np.add(channels, weight * self._value, out=channels, where=self._mask)


class Drift:
    """An offset of `rate` per second since the start."""

    def __init__(self, window: Window, mask: Mask, rate: float) -> None:
        self._window, self._mask, self._rate = window, mask, rate

    def step(self, k: int, channels: Array) -> None:
        """Add what has gathered since the start."""
        weight = self._window.weight(k)
        if weight:
            offset = weight * self._rate * ((k - self._window.first) * _STEP_S)
            np.add(channels, offset, out=channels, where=self._mask)


class Gain:
    """The channels are multiplied by `factor`."""

    def __init__(self, window: Window, mask: Mask, factor: float) -> None:
        self._window, self._mask, self._factor = window, mask, factor

    def step(self, k: int, channels: Array) -> None:
        """Scale the channels."""
        weight = self._window.weight(k)
        if weight:
            scale = 1.0 + weight * (self._factor - 1.0)
            np.multiply(channels, scale, out=channels, where=self._mask)


class Quantisation:
    """The nearest multiple of `size`, halves to the even one."""

    def __init__(self, window: Window, mask: Mask, size: float) -> None:
        self._window, self._mask, self._size = window, mask, size
        self._rounded = zeros()

    def step(self, k: int, channels: Array) -> None:
        """Round the channels."""
        size = self._window.weight(k) * self._size
        if size:
            np.divide(channels, size, out=self._rounded)
            np.rint(self._rounded, out=self._rounded)
            np.multiply(self._rounded, size, out=channels, where=self._mask)


class Saturation:
    """The range `low` to `high`; infinite where there is no end."""

    def __init__(self, window: Window, mask: Mask, low: float, high: float) -> None:
        self._window, self._mask = window, mask
        self._low, self._high = low, high

    def step(self, k: int, channels: Array) -> None:
        """Cut off what is outside the range."""
        if self._window.weight(k):
            np.maximum(channels, self._low, out=channels, where=self._mask)
            np.minimum(channels, self._high, out=channels, where=self._mask)


class Stuck:
    """The channels keep `value`, or for None what they are at the first sample of the window."""

    def __init__(self, window: Window, mask: Mask, value: float | None = None) -> None:
        self._window, self._mask = window, mask
        self._kept = zeros()
        self._takes_first = value is None
        if value is not None:
            self._kept.fill(value)

    def step(self, k: int, channels: Array) -> None:
        """Put the kept value in the channels' place."""
        if self._takes_first and k == self._window.first:
            self._kept[:] = channels
        if self._window.weight(k):
            np.copyto(channels, self._kept, where=self._mask)


class Noise:
    """White noise with the standard deviation `rms`.

    A sample's draws do not depend on which channels are meant, so that a channel has the same noise
    alone and among others.
    """

    def __init__(self, window: Window, mask: Mask, rms: float, random: np.random.Generator) -> None:
        self._window, self._mask, self._rms = window, mask, rms
        self._random, self._draw = random, zeros()

    def step(self, k: int, channels: Array) -> None:
        """Add the next draws."""
        weight = self._window.weight(k)
        if weight:
            self._random.standard_normal(out=self._draw)
            np.multiply(self._draw, weight * self._rms, out=self._draw)
            np.add(channels, self._draw, out=channels, where=self._mask)


class Spikes:
    """Each sample is off by `height` with the probability `share`, half of them downward."""

    def __init__(
        self, window: Window, mask: Mask, height: float, share: float, random: np.random.Generator
    ) -> None:
        self._window, self._mask = window, mask
        self._height, self._share = height, share
        self._random, self._draw = random, zeros()
        self._hit = np.zeros_like(mask)

    def step(self, k: int, channels: Array) -> None:
        """Add the spikes of this sample."""
        weight = self._window.weight(k)
        if weight:
            draw, hit = self._draw, self._hit
            self._random.random(out=draw)
            np.less(draw, self._share, out=hit)
            np.logical_and(hit, self._mask, out=hit)
            np.subtract(draw, self._share / 2, out=draw)
            np.copysign(weight * self._height, draw, out=draw)
            np.add(channels, draw, out=channels, where=hit)
