"""A signal as the few samples that straight lines between them need."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]


def kept_rows(values: Array, tolerance: float) -> Rows:
    """Return which samples of a signal (n,), n > 0, to keep, first and last among them, so that
    straight lines between those pass every other within `tolerance`.

    From each kept sample on, the next is the last one before the cone of lines that pass all
    between them closes. Samples beside one that is not a number are kept.
    """
    rows, start = [0], 0
    while start < len(values) - 1:
        start = _next(values, start, tolerance)
        rows.append(start)
    return np.array(rows)


def _next(values: Array, start: int, tolerance: float) -> int:
    """Return the sample after `start` to keep."""
    low, high = -math.inf, math.inf
    origin, last, best = float(values[start]), len(values), start + 1
    if math.isnan(origin):
        return _end_of_gap(values, start)
    for k in range(start + 1, last):
        value, steps = float(values[k]), k - start
        if math.isnan(value):
            break
        slope = (value - origin) / steps
        if low <= slope <= high:
            best = k
        low = max(low, (value - tolerance - origin) / steps)
        high = min(high, (value + tolerance - origin) / steps)
        if low > high:
            break
    return best


def _end_of_gap(values: Array, start: int) -> int:
    """Return the last sample of a gap that begins with `start`, or the one after it."""
    after = np.flatnonzero(~np.isnan(values[start:]))
    end = start + int(after[0]) if len(after) else len(values)
    return end - 1 if end - 1 > start else min(end, len(values) - 1)
