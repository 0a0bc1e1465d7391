"""Times of many samples as a few figures."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

EDGES_MS: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


def percentiles(name: str, times: npt.NDArray[np.float64]) -> dict[str, float]:
    """Return median, 99th percentile and maximum of times (n,) [ms]; nothing of no times.

    Both percentiles are times that occurred: at least half and 99 % are no longer.
    """
    if not len(times):
        return {}
    median, p99 = np.quantile(times, (0.5, 0.99), method="inverted_cdf")
    return {
        f"{name}_p50_ms": float(median),
        f"{name}_p99_ms": float(p99),
        f"{name}_max_ms": float(times.max()),
    }


def histogram(times: npt.NDArray[np.float64]) -> dict[str, list[Any]]:
    """Return how many times (n,) [ms] lie up to each edge and above the one before; the last count
    is of those above all edges.
    """
    places = np.searchsorted(EDGES_MS, times, side="left")
    counts = np.bincount(places, minlength=len(EDGES_MS) + 1)
    return {"up_to_ms": list(EDGES_MS), "samples": counts.tolist()}
