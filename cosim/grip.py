"""How much of its grip each tyre uses."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.quantities import CORNERS

Array = npt.NDArray[np.float64]


def grip_figures(share: Array) -> dict[str, dict[str, float]]:
    """Return peak and mean of each tyre's share of grip (n, 4) over a run in %.

    The share is the tyre's force in its friction ellipse, 1 at the limit. Empty where the vehicle
    does not tell it.
    """
    if not len(share) or not np.isfinite(share).all():
        return {}
    peaks, means = 100.0 * share.max(axis=0), 100.0 * share.mean(axis=0)
    return {
        corner: {"peak_percent": float(peak), "mean_percent": float(mean)}
        for corner, peak, mean in zip(CORNERS, peaks, means, strict=True)
    }
