"""What the paper's tables say beyond their words: a reference that grows with the speed.

The rms of a reference follows from RMSE and accuracy (`PaperRow.truth_rms`). On flat manoeuvres,
where a suspension hardly moves, it is proportional to the driving speed named in the row: v_rel
seems to hold a projection v_x sin(theta0) of the speed. This is inference from the tables; the
paper does not say so.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from sensor.paper import PaperRow, paper_rows

LIMIT_M_S2: Final = 4.0
"""Lateral acceleration v^2/R [m/s2] above which a turn's speed is not taken at its word: the car
may have lost speed in it.
"""
WHEELBASE_M: Final = 2.675
"""Wheelbase of the paper's Table 1 [m]."""

Kind = Literal["lap", "bumps", "limit", "misprint", "flat"]


@dataclass(frozen=True)
class Reading:
    """A row of Table 4, read: the speed in its name [m/s] (None for laps), what kind of row it is,
    and the rms of its reference [m/s] with the range that the printed digits leave.
    """

    row: PaperRow
    kind: Kind
    speed: float | None
    truth_rms: float
    lowest: float
    highest: float

    @property
    def slope(self) -> float | None:
        """Reference rms over speed (ratio); None for laps."""
        return None if self.speed is None else self.truth_rms / self.speed


@dataclass(frozen=True)
class Fit:
    """Least squares through the origin: reference rms = slope * speed, over `rows`; `deviation` is
    the standard deviation of the slope.
    """

    slope: float
    deviation: float
    rows: tuple[Reading, ...]

    @property
    def angle(self) -> float:
        """The angle theta0 whose sine is the slope [rad]."""
        return float(np.arcsin(self.slope))

    def implied_speed(self, reading: Reading) -> float:
        """Speed [m/s] at which the fit gives the row's reference."""
        return reading.truth_rms / self.slope


def readings(rows: Iterable[PaperRow] | None = None) -> tuple[Reading, ...]:
    """Read every row of Table 4, in the printed order."""
    return tuple(map(_read, paper_rows() if rows is None else rows))


def projection(read: Iterable[Reading] | None = None) -> Fit:
    """Fit reference rms against speed over the flat rows, each weighted by its printed digits."""
    flat = tuple(one for one in read or readings() if one.kind == "flat")
    speed = np.array([one.speed for one in flat], dtype=np.float64)
    truth = np.array([one.truth_rms for one in flat])
    weight = np.array([(one.highest - one.lowest) ** -2.0 for one in flat])
    information = float(np.sum(weight * speed**2))
    slope = float(np.sum(weight * speed * truth)) / information
    scatter = float(np.sum(weight * (truth - slope * speed) ** 2)) / (len(flat) - 1)
    return Fit(slope, float(np.sqrt(scatter / information)), flat)


def mean_accuracy(*splits: str) -> float:
    """Plain mean of the accuracies [%] over the rows of the splits, over all rows for none."""
    rows = [row for row in paper_rows() if not splits or row.split in splits]
    return float(np.mean([row.accuracy for row in rows]))


def overall_from_wheels(row: PaperRow) -> float:
    """RMSE over all wheels [m/s] that follows from the four at the wheels."""
    return float(np.sqrt(np.mean(np.square(row.rmse))))


def _read(row: PaperRow) -> Reading:
    speed = _number(r"at (\d+) ?km/?h", row.scenario)
    speed = None if speed is None else speed / 3.6
    # Half a unit of the last printed digit: 0.00005 m/s and 0.05 %.
    missing = 1.0 - row.accuracy / 100.0
    lowest = (row.rmse_overall - 5e-5) / (missing + 5e-4)
    highest = (row.rmse_overall + 5e-5) / (missing - 5e-4)
    return Reading(row, _kind(row, speed), speed, row.truth_rms, lowest, highest)


def _kind(row: PaperRow, speed: float | None) -> Kind:
    if speed is None:
        return "lap"
    if row.scenario.startswith("Bumpy"):
        return "bumps"
    if row.scenario == "Slalom 18 m at 25 km/h":
        return "misprint"  # 97.8 % would fit the other rows, 98.8 % doubles the reference
    radius = _number(r"radius of (\d+) m", row.scenario)
    return "limit" if radius is not None and speed**2 / radius > LIMIT_M_S2 else "flat"


def _number(pattern: str, text: str) -> float | None:
    found = re.search(pattern, text)
    return float(found.group(1)) if found else None
