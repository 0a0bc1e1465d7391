"""Whether a predicted standard deviation tells the truth about the error."""

from typing import Final

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

WIDTH: Final = 1.645
"""Half width of the band in standard deviations: it holds 90 % of a normal distribution."""
COVERED_SHARE: Final = 90.0
"""Share of errors [%] that the band should hold."""


def coverage(error: Array, deviation: Array) -> Array | None:
    """Return the share [%] of errors (samples, 4) within 1.645 predicted deviations, per wheel.

    `deviation` (samples, 4) is in the unit of `error`; None where it is not offered (NaN
    throughout). A single NaN among numbers is a sample that is not covered.
    """
    if np.isnan(deviation).all():
        return None
    return np.asarray(100.0 * np.mean(np.abs(error) <= WIDTH * deviation, axis=0))
