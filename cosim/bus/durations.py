"""Durations of many samples: percentiles without keeping a list of Python numbers."""

from __future__ import annotations

from array import array

import numpy as np


class Durations:
    """Keeps durations [ms], eight bytes each."""

    def __init__(self) -> None:
        self._values = array("d")

    def add(self, milliseconds: float) -> None:
        """Keep one."""
        self._values.append(milliseconds)

    def figures(self, name: str) -> dict[str, float]:
        """Return median, 99th percentile and largest [ms] as figures `<name>_p50_ms` and so on;
        none where there are no durations.
        """
        if not self._values:
            return {}
        p50, p99, largest = np.percentile(np.array(self._values), (50.0, 99.0, 100.0)).tolist()
        return {f"{name}_p50_ms": p50, f"{name}_p99_ms": p99, f"{name}_max_ms": largest}
