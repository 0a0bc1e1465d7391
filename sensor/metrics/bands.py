"""Errors by frequency, in bands that add up to the whole.

The edges follow the car: heave, pitch and roll of the body lie at 1.2 to 2 Hz, wheel hop at 14.5 to
15.3 Hz (docs/vehicle.md). Below 0.5 Hz the suspension moves with the driving (accelerating,
cornering), above 20 Hz with what the tyre passes on.

The spectrum is the orthonormal cosine transform (DCT-II) of the whole run: the Fourier transform of
the run and its mirror image. Its squares sum to those of the samples (Parseval), and since the
mirror image meets the run without a step, a run that ends elsewhere than it began does not leak
into the high bands as it would from a plain Fourier transform.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.channels import SAMPLE_RATE_HZ
from sensor.metrics.match import Match

Array = npt.NDArray[np.float64]

BANDS: Final = {
    "driving": (0.0, 0.5),
    "body": (0.5, 2.0),
    "between": (2.0, 8.0),
    "wheel hop": (8.0, 20.0),
    "above": (20.0, 50.0),
}
"""Lower and upper edge of each band [Hz]; the lower edge belongs to the band, and the last band
holds the rest.
"""


def by_band(estimate: Array, truth: Array) -> dict[str, Match]:
    """Compare estimate and truth, both (samples, 4) in m/s, band by band, all wheels pooled.

    The samples are taken as following each other at 100 Hz.
    """
    errors, truths = band_rms(estimate - truth), band_rms(truth)
    return {name: Match(errors[name], truths[name]) for name in BANDS}


def band_rms(velocities: Array) -> dict[str, float]:
    """Return the rms of each band of (samples, wheels), in their unit, over all wheels."""
    from scipy.fft import dct  # here, since a command that shows help needs none

    samples = len(velocities)
    squares = np.square(dct(velocities, type=2, axis=0, norm="ortho")).sum(axis=1)
    frequencies = np.arange(samples) * (SAMPLE_RATE_HZ / (2.0 * samples))
    edges = [low for low, _ in BANDS.values()]
    band = np.searchsorted(edges, frequencies, side="right") - 1
    means = np.bincount(band, squares, len(BANDS)) / velocities.size
    return {name: float(value) for name, value in zip(BANDS, np.sqrt(means), strict=True)}
