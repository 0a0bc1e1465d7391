"""The car on a bench, as the loop sees it: an FMU here, a simulator of a HIL bench elsewhere.

Five calls are all that a run needs; `cosim.vehicle.Vehicle` answers them with an FMU, and an
adapter to another bench needs to answer no more (docs/regression.md shows one for ASAM XIL).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim.quantities import CHANNEL_QUANTITIES, OUTPUT_QUANTITIES, POSE, SENSOR_STAGE, TRUTH

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class State:
    """The car's outputs at t_k in SI units; views of one buffer that each reading refills.

    channels (14,), truth (4,) [m/s, positive in extension], pose (3,) [m, m, rad],
    recorded (all beside channels and truth, in the order of `cosim.quantities.RECORDED`), stage
    (11,) what production sensors deliver (`sensor.STAGE`); NaN where the bench has none.
    """

    channels: Array
    truth: Array
    pose: Array
    recorded: Array
    stage: Array

    @classmethod
    def over(cls, values: Array) -> State:
        """Return the views of a buffer in the order of `OUTPUT_QUANTITIES`."""
        if values.shape != (len(OUTPUT_QUANTITIES),):
            raise ValueError(f"a state has {len(OUTPUT_QUANTITIES)} values, not {values.shape}")
        n = len(CHANNEL_QUANTITIES)
        m = n + len(TRUTH)
        stage = OUTPUT_QUANTITIES.index(SENSOR_STAGE[0])
        return cls(
            channels=values[:n],
            truth=values[n:m],
            pose=values[m : m + len(POSE)],
            recorded=values[m:],
            stage=values[stage : stage + len(SENSOR_STAGE)],
        )


class Testbench(Protocol):
    """A car that can be read, told and stepped. Every call raises `FmuError` where it fails."""

    def connect(self) -> None:
        """Take hold of the bench and bring the car to t = 0, ready to be read."""

    def read(self) -> State:
        """Return the outputs at the present time, all finite but those that it never has."""

    def write(self, driver_command: Array, damper_command: Array) -> None:
        """Tell the commands to be held from now on: (3,) steering-wheel angle [rad], accelerator
        and brake 0..1; (4,) dampers, 0 soft to 1 hard, in the order FL FR RL RR.
        """

    def step(self, k: int) -> None:
        """Go from t_k to t_k+1; a bench that goes by its own clock waits until it is there."""

    def stop(self) -> None:
        """Let go of the bench, whatever happened before; may be called twice."""


# It is not for pytest to collect where a test imports it.
Testbench.__test__ = False  # type: ignore[attr-defined]
