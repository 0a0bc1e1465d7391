"""Whether a scenario still is the row of the paper's Table 4 that it names."""

from __future__ import annotations

import re
from typing import Final

from cosim.scenario.manoeuvre import (
    ConstantRadius,
    ConstantSpeed,
    DoubleLaneChange,
    SineWithDwell,
    Slalom,
)
from cosim.scenario.schema import Scenario

# First word of the row, and what has to be driven for it
_LAPS: Final = {"Heilbronn": "heilbronn", "Rural": "rural", "Hockenheimring": "hockenheim"}
_MANOEUVRES: Final[dict[str, type]] = {
    "Constant": ConstantRadius,
    "Double": DoubleLaneChange,
    "Sine": SineWithDwell,
    "Bumpy": ConstantSpeed,
    "Slalom": Slalom,
}
_NUMBERS: Final = re.compile(r"(\d+) ?(km/h|kmh|deg|m)\b")


def row_of(scenario: Scenario) -> str | None:
    """Return the row, or None where the scenario names none or has been changed: another road,
    driver, speed, radius, amplitude or spacing, or not driven to the end. Any surface may be the
    paper's.
    """
    row = scenario.paper_row
    if row is None or scenario.duration != "lap":
        return None
    first = row.split()[0]
    same = _same_lap(scenario, row) if first in _LAPS else _same_manoeuvre(scenario, row)
    return row if same else None


def _same_lap(scenario: Scenario, row: str) -> bool:
    style = f"{scenario.driver.style.capitalize()} driver"
    track = _LAPS[row.split()[0]]
    free = scenario.manoeuvre is None and scenario.driver.speed_kmh is None
    return free and style in row and scenario.road.track == track


def _same_manoeuvre(scenario: Scenario, row: str) -> bool:
    manoeuvre = scenario.manoeuvre
    if not isinstance(manoeuvre, _MANOEUVRES[row.split()[0]]):
        return False
    given: dict[str, float | None] = {
        "km/h": scenario.driver.speed_kmh,
        "m": manoeuvre.spacing_m if isinstance(manoeuvre, Slalom) else scenario.road.radius_m,
        "deg": manoeuvre.amplitude_deg if isinstance(manoeuvre, SineWithDwell) else None,
    }
    found = _NUMBERS.findall(row)
    return all(given[unit.replace("kmh", "km/h")] == float(number) for number, unit in found)
