"""Faults of the messages that carry the channels: late, lost, or from the wrong sensor.

The channels of one fault share a message: they are late together and lost together.
"""

from __future__ import annotations

import math

import numpy as np

from cosim.faults.fault import Array, Mask, zeros
from cosim.faults.window import Window
from sensor.channels import CHANNELS


class _Past:
    """The last samples; reads them between two, on the straight line through both."""

    def __init__(self, longest: float) -> None:
        """Keep the newest sample and those of up to `longest` samples before."""
        self._rows = np.zeros((math.ceil(longest) + 1, len(CHANNELS)))
        self._read = zeros()

    def keep(self, k: int, channels: Array) -> None:
        """Take sample k."""
        self._rows[k % len(self._rows)] = channels

    def at(self, instant: float) -> Array:
        """Return the channels (14,) at an instant [samples]; before the first sample, its own."""
        before = int(max(instant, 0.0))
        share = max(instant, 0.0) - before
        read = self._read
        first: Array = self._rows[before % len(self._rows)]
        if not share:
            return first
        np.subtract(self._rows[(before + 1) % len(self._rows)], first, out=read)
        np.multiply(read, share, out=read)
        np.add(read, first, out=read)
        return read


class Delay:
    """The channels are `age` samples old."""

    def __init__(self, window: Window, mask: Mask, age: float) -> None:
        self._window, self._mask, self._age = window, mask, age
        self._past = _Past(age)

    def step(self, k: int, channels: Array) -> None:
        """Read the channels as they were."""
        self._past.keep(k, channels)
        weight = self._window.weight(k)
        if weight:
            np.copyto(channels, self._past.at(k - weight * self._age), where=self._mask)


class Jitter:
    """The channels are 0 to `oldest` samples old, uniform, but never older than those before."""

    def __init__(
        self, window: Window, mask: Mask, oldest: float, random: np.random.Generator
    ) -> None:
        self._window, self._mask, self._oldest = window, mask, oldest
        self._past, self._random = _Past(oldest), random
        self._last = 0.0

    def step(self, k: int, channels: Array) -> None:
        """Read the channels as they were."""
        self._past.keep(k, channels)
        weight = self._window.weight(k)
        if weight:
            # A reader keeps what is newest: a message that was overtaken is of no use.
            self._last = max(self._last, k - weight * self._oldest * self._random.random())
            np.copyto(channels, self._past.at(self._last), where=self._mask)


class Dropout:
    """Samples that are missing: the last one that came is held, or NaN stands there.

    `share` of them is missing. `outage` is the mean length of an outage in samples, None where each
    sample is missing by itself. Outages are those of a two-state Markov chain (Gilbert 1960), which
    begins in its steady state.
    """

    def __init__(
        self,
        window: Window,
        mask: Mask,
        share: float,
        outage: float | None,
        hold: bool,
        random: np.random.Generator,
    ) -> None:
        self._window, self._mask = window, mask
        self._share, self._outage, self._hold = share, outage, hold
        self._random = random
        self._last = zeros() if hold else np.full(len(CHANNELS), np.nan)
        self._missing = False

    def step(self, k: int, channels: Array) -> None:
        """Lose the sample or keep it."""
        weight = self._window.weight(k)
        self._missing = weight > 0.0 and self._random.random() < self._probability(k, weight)
        if self._missing and not (self._hold and k == 0):
            np.copyto(channels, self._last, where=self._mask)
        elif self._hold:  # the first sample of all has none before it
            self._last[:] = channels

    def _probability(self, k: int, weight: float) -> float:
        share = weight * self._share
        if self._outage is None or k == self._window.first or share >= 1.0:
            return share
        if self._missing:
            return 1.0 - 1.0 / self._outage
        return share / (1.0 - share) / self._outage


class SwappedWheels:
    """Two channels carry each other's signal."""

    def __init__(self, window: Window, one: int, other: int) -> None:
        self._window, self._one, self._other = window, one, other

    def step(self, k: int, channels: Array) -> None:
        """Exchange the two."""
        if self._window.weight(k):
            one, other = float(channels[self._one]), float(channels[self._other])
            channels[self._one], channels[self._other] = other, one
