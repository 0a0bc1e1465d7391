"""Runs of a data set from channels and truth alone, for tests that need no more of them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from sensor.channels import PASSIVE_COMMAND, STAGED
from sensor.dataset import SIGNALS, Run


def run_of(name: str, channels: npt.ArrayLike, truth: npt.ArrayLike) -> Run:
    """Return a run with passive dampers on an even road, its production sensors without fault."""
    measured = np.asarray(channels, dtype=np.float32)
    count = len(measured)
    return Run(
        name,
        channels=measured,
        stage=np.ascontiguousarray(measured[:, STAGED]),
        commands=np.full((count, 4), PASSIVE_COMMAND, dtype=np.float32),
        truth=np.asarray(truth, dtype=np.float32),
        road=np.zeros((count, len(SIGNALS["road"])), dtype=np.float32),
    )
