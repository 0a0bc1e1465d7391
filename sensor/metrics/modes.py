"""The four modes of the wheels: heave, roll, pitch, and warp, which no body motion shows."""

from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.metrics.match import Match, match

Array = npt.NDArray[np.float64]

MODES: Final = {
    "heave": (1.0, 1.0, 1.0, 1.0),
    "roll": (1.0, -1.0, 1.0, -1.0),
    "pitch": (1.0, 1.0, -1.0, -1.0),
    "warp": (1.0, -1.0, -1.0, 1.0),
}
"""Signs of FL FR RL RR; a mode's velocity [m/s] is the mean of the signed velocities at the wheels.
"""


def modal(velocities: Array) -> Array:
    """Return the velocities (samples, 4) at the wheels as modes (samples, 4), order of MODES [m/s].

    The signs are orthogonal, so the mean squares of the four modes sum to the mean square over all
    wheels.
    """
    return np.asarray(velocities @ np.array(list(MODES.values())).T / len(MODES))


def by_mode(estimate: Array, truth: Array) -> dict[str, Match]:
    """Compare estimate and truth, both (samples, 4) in m/s, mode by mode."""
    modes, true_modes = modal(estimate), modal(truth)
    return {name: match(modes[:, i], true_modes[:, i]) for i, name in enumerate(MODES)}
