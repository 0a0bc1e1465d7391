"""A run as its mirror image would have been recorded: left and right change places.

The car is symmetric about its x-z plane, so the mirror image of a run is a run of the mirrored car
on the mirrored road (ISO 8855 axes: y, roll and yaw change sign; x, z and pitch do not). It costs
no driving and is as good a run for training as the one that was driven.
"""

from dataclasses import replace

import numpy as np

from sensor.channels import CHANNELS, COMMANDS, OUTPUTS, ROAD, STAGE, Channel
from sensor.dataset import Float32, Run

_TURNED = (".ay", ".RollVel", ".YawRate", ".SteerAngleFL", ".SteerAngleFR", ".WhlAng")
_SIDES = {"FL": "FR", "FR": "FL", "RL": "RR", "RR": "RL"}


def mirrored(run: Run) -> Run:
    """Return the mirror image of a run."""
    return replace(
        run,
        channels=_mirrored(run.channels, CHANNELS),
        stage=_mirrored(run.stage, STAGE),
        commands=_mirrored(run.commands, COMMANDS),
        truth=_mirrored(run.truth, OUTPUTS),
        road=_mirrored(run.road, ROAD),
    )


def _mirrored(values: Float32, signals: tuple[Channel, ...]) -> Float32:
    names = [signal.name for signal in signals]
    places = [names.index(_opposite(name)) for name in names]
    signs = np.array([-1.0 if name.endswith(_TURNED) else 1.0 for name in names], dtype=np.float32)
    return np.asarray(values[:, places] * signs, dtype=np.float32)


def _opposite(name: str) -> str:
    """Return the signal's name on the other side."""
    for side, other in _SIDES.items():
        if side in name:
            return name.replace(side, other)
    return name
