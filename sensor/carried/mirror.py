"""A run as its mirror image: left and right change places.

The car is symmetric about its x-z plane but for its centre of gravity, which lies a few centimetres
to the right of the middle, so the features and the truth of a run, mirrored, are those of the
mirrored car on the mirrored road: as good a run for training as the one that was driven. Mirrored
are the features, not the channels, whose residuals would be taken with the centre of gravity on the
wrong side.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from sensor.carried.features import FeatureConfig
from sensor.carried.streams import Sequence4
from sensor.channels import OUTPUT_NAMES

# ISO 8855: y, roll and yaw change sign; x, z and pitch do not
_TURNED: Final = {"ay", "RollVel", "YawRate", "Roll", "SteerAngleFL", "SteerAngleFR", "WhlAng"}
_SIDES: Final = {"FL": "FR", "FR": "FL", "RL": "RR", "RR": "RL"}


class Mirror:
    """Makes mirror images of runs with these features."""

    def __init__(self, config: FeatureConfig) -> None:
        names = [*config.names, "level"]
        self._places = [names.index(_opposite(name)) for name in names]
        self._signs = np.array([-1 if _base(n) in _TURNED else 1 for n in names], dtype=np.float32)
        self._wheels = [OUTPUT_NAMES.index(_opposite(name)) for name in OUTPUT_NAMES]

    def image(self, run: Sequence4) -> Sequence4:
        """Return the mirror image of a run."""
        features = run.features[:, self._places]
        features *= self._signs
        return replace(run, features=features, truth=run.truth[:, self._wheels])


def _base(name: str) -> str:
    """Return the signal that a feature is made of: "ay" of "d2 ay", "RollVel" of "RollVel@+3"."""
    return name.split("@")[0].split(" ")[-1].split(".")[-1]


def _opposite(name: str) -> str:
    """Return the name of the same signal on the other side."""
    for side, other in _SIDES.items():
        if f".{side}" in name or f"Angle{side}" in name:
            return name.replace(side, other)
    return name
