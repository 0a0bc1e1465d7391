"""What a manoeuvre is to the rest: a line, a speed, and what lies over the driver's commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from cosim.driver import PathDriver
from cosim.driver_model import DriverModel
from cosim.manoeuvre.motion import Motion
from cosim.manoeuvre.programme import Programme, ProgrammedDriver
from cosim.road.track import Track

Array = npt.NDArray[np.float64]
Figures = dict[str, float]

RUN_UP_S: Final = 2.0  # of straight driving at constant speed before anything happens [s]
SPARE_ROAD: Final = 20.0  # behind the end of a manoeuvre [m]
KMH: Final = 3.6


@dataclass(frozen=True)
class Plan:
    """`speed` (n,) [m/s] over `line.s`; `expected_s` is the time that it takes. `figures` tells
    how well it was driven; `end` says why the run is over. Without a `programme` it ends where the
    line does.
    """

    line: Track
    speed: Array
    expected_s: float
    figures: Callable[[Motion], Figures]
    programme: Programme | None = None
    end: str = "end of the manoeuvre"

    def driver(self, step_s: float, friction: float = 1.0) -> PathDriver | ProgrammedDriver:
        """Return the driver block, who knows the road's friction."""
        driver = PathDriver(self.line, self.speed, step_s, DriverModel().on(friction))
        return driver if self.programme is None else ProgrammedDriver(driver, self.programme)


class Manoeuvre(Protocol):
    """What is driven. `road_length` [m] is how long a straight has to be for it, None where the
    road decides itself.
    """

    @property
    def road_length(self) -> float | None:
        """Length that a straight road needs [m]."""

    def plan(self, track: Track) -> Plan:
        """Return how it is driven on this road."""


def constant(line: Track, speed: float) -> Array:
    """Return one speed [m/s] everywhere on a line (n,)."""
    return np.full_like(line.s, speed)


def speed_figures(vx: Array, wanted: float) -> Figures:
    """Return mean speed and largest deviation from the wanted speed; all but the figures [m/s]."""
    return {
        "speed_mean_kmh": float(vx.mean()) * KMH,
        "speed_deviation_kmh": float(np.abs(vx - wanted).max()) * KMH,
    }
