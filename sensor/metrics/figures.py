"""Figures that compare an estimate with the truth, per wheel and over all wheels pooled.

NRMSE = rms(estimate - truth) / rms(truth) and accuracy = 100 (1 - NRMSE) are equations 1 and 2 of
the paper. Accuracy says nothing where the truth hardly moves, so it is flagged as meaningless below
10 mm/s rms; the RMSE in m/s always counts.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.channels import OUTPUT_NAMES
from sensor.errors import SensorError
from sensor.metrics.match import LEAST_TRUTH_RMS, rms

SIGN_THRESHOLD = 0.020
"""Truth magnitude [m/s] above which the sign of the estimate is compared: it decides what a damper
does.
"""
BAND_PERCENTILES = (2.5, 97.5)

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Figures:
    """Figures of one wheel or of all pooled, in m/s except where said.

    `nrmse` (ratio) and `accuracy` (percent) are None if the truth is exactly zero. `sign_agreement`
    is the percentage of right signs among the `moving_samples` with |truth| > 20 mm/s, None if
    there are none. The band holds the central 95 % of errors.
    """

    rmse: float
    truth_rms: float
    nrmse: float | None
    accuracy: float | None
    accuracy_meaningful: bool
    max_abs_error: float
    error_low: float
    error_high: float
    sign_agreement: float | None
    moving_samples: int


@dataclass(frozen=True)
class Metrics:
    """Figures of a run: number of valid samples, `wheels` in the order of OUTPUTS, and `overall`
    with all wheels pooled.
    """

    samples: int
    wheels: tuple[Figures, ...]
    overall: Figures

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers for JSON, wheels keyed by output name (no NaN ever)."""
        wheels = {
            name: asdict(figures) for name, figures in zip(OUTPUT_NAMES, self.wheels, strict=True)
        }
        return {"samples": self.samples, "wheels": wheels, "overall": asdict(self.overall)}


def rmse(estimate: Array, truth: Array) -> float:
    """Root mean square of estimate - truth [m/s], all elements pooled."""
    return rms(estimate - truth)


def nrmse(estimate: Array, truth: Array) -> float | None:
    """Equation 1: RMSE over the rms of the truth (ratio); None if the truth is exactly zero."""
    reference = rms(truth)
    return rmse(estimate, truth) / reference if reference > 0.0 else None


def accuracy(estimate: Array, truth: Array) -> float | None:
    """Equation 2: 100 (1 - NRMSE) in percent; None if the truth is exactly zero."""
    ratio = nrmse(estimate, truth)
    return None if ratio is None else 100.0 * (1.0 - ratio)


def evaluate(estimate: Array, truth: Array, valid: npt.NDArray[np.bool_] | None = None) -> Metrics:
    """Compare estimate with truth, both (samples, 4) in m/s, where `valid` (samples,) holds.

    Without `valid`, rows whose estimate is NaN (the first samples of a window) are left out. Raises
    SensorError if the shapes differ, if nothing is left, or if a valid row holds a NaN.
    """
    if (
        estimate.shape != truth.shape
        or estimate.ndim != 2
        or estimate.shape[1] != len(OUTPUT_NAMES)
    ):
        raise SensorError(
            f"estimate {estimate.shape} and truth {truth.shape} must both be (samples, 4)."
        )
    rows = ~np.isnan(estimate).any(axis=1) if valid is None else valid
    if not rows.any():
        raise SensorError(f"none of the {len(estimate)} samples has a valid estimate.")
    estimate, truth = estimate[rows], truth[rows]
    if not (np.isfinite(estimate).all() and np.isfinite(truth).all()):
        raise SensorError("a sample marked valid holds a NaN or infinite estimate or truth.")
    wheels = tuple(_figures(estimate[:, [i]], truth[:, [i]]) for i in range(len(OUTPUT_NAMES)))
    return Metrics(len(estimate), wheels, _figures(estimate, truth))


def _figures(estimate: Array, truth: Array) -> Figures:
    error = estimate - truth
    low, high = np.percentile(error, BAND_PERCENTILES)
    reference = rms(truth)
    moving = np.abs(truth) > SIGN_THRESHOLD
    agreement = 100.0 * float(np.mean((estimate * truth)[moving] > 0.0)) if moving.any() else None
    return Figures(
        rmse=rms(error),
        truth_rms=reference,
        nrmse=nrmse(estimate, truth),
        accuracy=accuracy(estimate, truth),
        accuracy_meaningful=reference >= LEAST_TRUTH_RMS,
        max_abs_error=float(np.max(np.abs(error))),
        error_low=float(low),
        error_high=float(high),
        sign_agreement=agreement,
        moving_samples=int(np.count_nonzero(moving)),
    )
