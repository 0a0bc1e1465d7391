"""The block between measurement and sensor: the faults of a scenario, one after the other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.faults.fault import Array, Fault, Mask, zeros


class NoFaults:
    """The channels arrive as they were measured."""

    bridged: Array

    def step(self, k: int, measured: Array) -> Array:
        """Return `measured` itself, which is `bridged`, too."""
        self.bridged = measured
        return measured


class FaultStack:
    """Faults in their order, each on what the one before it left.

    `gaps` tells whether a channel may be NaN. `bridged` (14,) are the channels of the last sample
    with the last value in the place of each NaN (0 before there was one), for those that read the
    channels without being an estimator that knows of gaps.
    """

    def __init__(self, faults: Sequence[Fault], gaps: bool) -> None:
        self._faults = tuple(faults)
        self.gaps = gaps
        self._given = zeros()
        self.bridged = zeros() if gaps else self._given
        self._there: Mask = np.zeros(len(self._given), dtype=np.bool_)

    def step(self, k: int, measured: Array) -> Array:
        """Take the channels (14,) of sample k as measured; return them as the sensor gets them, the
        same array every time.
        """
        given = self._given
        given[:] = measured
        for fault in self._faults:
            fault.step(k, given)
        if self.gaps:
            np.isfinite(given, out=self._there)
            np.copyto(self.bridged, given, where=self._there)
        return given
