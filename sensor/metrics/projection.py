"""The published study's presumed target: suspension velocity plus a projection of the speed.

Its reference values grow like 0.0079 v_x even on flat manoeuvres (`sensor.paper.reading`); 0.0079
is the sine of 0.45 deg. The vehicle FMU offers that target as `Car.PaperRelVel<pos>`.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.metrics.match import Match, match

Array = npt.NDArray[np.float64]

THETA0: Final = float(np.deg2rad(0.45))
"""Presumed angle [rad] between the study's axis and the vertical."""


def project(velocities: Array, speed: Array) -> Array:
    """Add v_x sin(theta0) to velocities (samples, 4) [m/s], with the speed (samples,) [m/s]."""
    return np.asarray(velocities + (speed * np.sin(THETA0))[:, np.newaxis])


def projected(estimate: Array, truth: Array, measured_speed: Array, true_speed: Array) -> Match:
    """Compare on the presumed target: the truth projected from the true speed, the estimate from
    the measured one, which a sensor knows.
    """
    return match(project(estimate, measured_speed), project(truth, true_speed))
