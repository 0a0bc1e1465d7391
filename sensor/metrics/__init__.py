"""Figures that compare estimates with the truth: per wheel and pooled, by mode, by frequency band,
against the published study's presumed target, and of a predicted deviation.
"""

from sensor.metrics.bands import BANDS, by_band
from sensor.metrics.deviation import COVERED_SHARE, WIDTH, coverage
from sensor.metrics.figures import (
    SIGN_THRESHOLD,
    Figures,
    Metrics,
    accuracy,
    evaluate,
    nrmse,
    rmse,
)
from sensor.metrics.match import LEAST_TRUTH_RMS, Match, rms
from sensor.metrics.modes import MODES, by_mode
from sensor.metrics.pool import pool
from sensor.metrics.projection import THETA0, project, projected

__all__ = [
    "BANDS",
    "COVERED_SHARE",
    "LEAST_TRUTH_RMS",
    "MODES",
    "SIGN_THRESHOLD",
    "THETA0",
    "WIDTH",
    "Figures",
    "Match",
    "Metrics",
    "accuracy",
    "by_band",
    "by_mode",
    "coverage",
    "evaluate",
    "nrmse",
    "pool",
    "project",
    "projected",
    "rms",
    "rmse",
]
