"""Which channel carries what: the linear filter fitted again without each group of channels.

Exact for a linear filter: the normal equations of a filter that lacks some channels are those of
the full one with their rows and columns left out. A group that another can stand in for shows less
than it carries.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sensor.baselines.fit import FILTERS, Shape, equations, pooled
from sensor.baselines.normal_equations import NormalEquations
from sensor.baselines.recipe import RIDGES
from sensor.channels import CHANNEL_NAMES
from sensor.conditions import Condition
from sensor.dataset import Run

GROUPS: Final[Mapping[str, tuple[str, ...]]] = {
    "IMU accelerations": ("Car.ax", "Car.ay", "Car.az"),
    "IMU angular rates": ("Car.RollVel", "Car.PitchVel", "Car.YawRate"),
    "v_x": ("Car.vx",),
    "steering angles": ("Car.SteerAngleFL", "Car.SteerAngleFR", "Steer.WhlAng"),
    "wheel speeds": ("Car.vFL", "Car.vFR", "Car.vRL", "Car.vRR"),
}
"""Channels by group; with channels "residual" the wheel speeds are their residuals."""


@dataclass(frozen=True)
class Ablation:
    """The error of the filter without one group (None: with all): RMSE [m/s], pooled and by wheel
    FL FR RL RR, and accuracy [%], on the runs that it is evaluated on.
    """

    without: str | None
    rmse: float
    wheels: tuple[float, float, float, float]
    accuracy: float


def ablation(
    condition: Condition,
    training: Sequence[Run],
    evaluation: Sequence[Run],
    shape: Shape = FILTERS["fir_residual_w64"],
    ridges: Sequence[float] = RIDGES,
) -> list[Ablation]:
    """Return the filter with all channels and without each group, in the order of `GROUPS`; each
    with the ridge that suits the evaluation runs best.

    Raises SensorError if no run is as long as the window.
    """
    fitted, checked = equations(shape, condition, training, evaluation)
    return [
        _without(group, fitted.without(gone), checked, ridges)
        for group, gone in [(None, []), *((name, _places(name)) for name in GROUPS)]
    ]


def _places(group: str) -> list[int]:
    return [CHANNEL_NAMES.index(name) for name in GROUPS[group]]


def _without(
    group: str | None,
    fitted: NormalEquations,
    checked: NormalEquations,
    ridges: Sequence[float],
) -> Ablation:
    errors = min((checked.rmse(fitted.solve(ridge)) for ridge in ridges), key=pooled)
    # The truth's own rms: what is left when every weight is zero and so is the constant in m/s.
    s = checked.standard
    silent = np.zeros_like(checked.moment)
    silent[-1] = -s.output_mean / s.output_std
    accuracy = 100.0 * (1.0 - pooled(errors) / pooled(checked.rmse(silent)))
    fl, fr, rl, rr = errors.tolist()
    return Ablation(group, pooled(errors), (fl, fr, rl, rr), accuracy)
