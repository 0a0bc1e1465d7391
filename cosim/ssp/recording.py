"""The direct run of a scenario as a table: what was commanded, and what the sensor estimated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.assembly import STEP_S, Assembly
from cosim.quantities import DAMPERS, DRIVER
from sensor.channels import OUTPUTS

RECORDING: Final = "extra/org.suspension-cosim/run.csv"
VALID: Final = "Sensor.Valid"


@dataclass(frozen=True)
class Recording:
    """Row k: `commands` (rows, 7) held from t_k to t_k+1, pedals and steering before the dampers;
    `estimates` (rows, 4) [m/s] of the sample at t_k and whether they are `valid` (rows,).
    """

    time: npt.NDArray[np.float64]
    commands: npt.NDArray[np.float64]
    estimates: npt.NDArray[np.float64]
    valid: npt.NDArray[np.float64]

    @property
    def stop_s(self) -> float:
        """Time of the last row [s]."""
        return (len(self.time) - 1) * STEP_S

    def csv(self) -> bytes:
        """Return the table, its columns named as the system's inputs and outputs."""
        names = ["time", *(q.name for q in (*DRIVER, *DAMPERS)), *(o.name for o in OUTPUTS), VALID]
        columns = np.column_stack([self.time, self.commands, self.estimates, self.valid])
        rows = (",".join(f"{value:.17g}" for value in row) for row in columns)
        return "\n".join([",".join(names), *rows, ""]).encode()


def record(assembly: Assembly, progress: Callable[[int, int], None] | None) -> Recording:
    """Run to the end and return what was recorded. Raises what a run raises."""
    assembly.run(progress)
    recorder = assembly.recorder
    return Recording(
        time=np.array(recorder.time),
        commands=np.hstack([recorder.group("driver"), recorder.group("command")]),
        estimates=recorder.group("estimate").copy(),
        valid=recorder.group("valid")[:, 0].copy(),
    )
