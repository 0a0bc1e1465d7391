"""The tube around a signal: how far another one lies outside it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

_SLACK = 1e-9  # of a sample, for tolerances that are a whole number of samples


def distance(one: Array, other: Array, tolerance: float) -> Array:
    """Return how far apart two signals (n,) of the same samples are at each, (n,), whatever the
    sign, where each may be up to `tolerance` samples before or after the other.

    The distance of a sample from a signal is that from the nearest value which the straight lines
    between its samples take within the tolerance. It is infinite where one is a number and the
    other is not one anywhere near.
    """
    return np.maximum(_outside(one, other, tolerance), _outside(other, one, tolerance))


def _outside(values: Array, other: Array, tolerance: float) -> Array:
    """Return how far each of the values lies outside what `other` takes near it."""
    low, high = _band(other, tolerance)
    with np.errstate(invalid="ignore"):
        found = np.maximum(np.maximum(low - values, values - high), 0.0)
    missing = np.isnan(values)
    found[missing & _near(np.isnan(other), tolerance)] = 0.0
    found[np.isnan(found)] = np.inf
    return found


def _band(values: Array, tolerance: float) -> tuple[Array, Array]:
    """Return the least and the greatest value within the tolerance of each sample."""
    whole = int(tolerance + _SLACK)
    low, high = values.copy(), values.copy()
    for shift in range(1, whole + 1):
        _widen(low, high, values, shift)
    part = tolerance - whole
    if part > _SLACK and len(values) > 1:
        between = values[:-1] + part * np.diff(values)  # at k + part
        _widen_by(low, high, between, whole, -1)
        between = values[1:] - part * np.diff(values)  # at k + 1 - part
        _widen_by(low, high, between, whole + 1, 1)
    return low, high


def _widen(low: Array, high: Array, values: Array, shift: int) -> None:
    """Take in the values that lie `shift` samples before and after."""
    if shift >= len(values):
        return
    for least, greatest, shifted in (
        (low[shift:], high[shift:], values[:-shift]),
        (low[:-shift], high[:-shift], values[shift:]),
    ):
        np.fmin(least, shifted, out=least)
        np.fmax(greatest, shifted, out=greatest)


def _widen_by(low: Array, high: Array, between: Array, shift: int, side: int) -> None:
    """Take in values between samples: those after (side -1) or before (1) each sample.

    `between[k]` lies between samples k and k + 1; it belongs to sample k - shift on the one side,
    to k + shift on the other.
    """
    count = len(low)
    source = np.arange(len(between))
    target = source + side * shift
    inside = (target >= 0) & (target < count)
    target, chosen = target[inside], between[source[inside]]
    low[target] = np.fmin(low[target], chosen)
    high[target] = np.fmax(high[target], chosen)


def _near(mask: Mask, tolerance: float) -> Mask:
    """Return where the mask is set within the tolerance."""
    found = mask.copy()
    for shift in range(1, min(int(tolerance + _SLACK), len(mask) - 1) + 1):
        found[shift:] |= mask[:-shift]
        found[:-shift] |= mask[shift:]
    return found
