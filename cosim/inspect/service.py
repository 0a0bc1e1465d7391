"""What an FMU can do for the test bench: as its vehicle, or as its sensor."""

from __future__ import annotations

from typing import Final

from cosim.check.description import Description
from cosim.check.finding import listed
from cosim.check.parts import Unit
from cosim.check.unit_names import DIMENSIONS, readings
from cosim.errors import did_you_mean
from cosim.inspect.facts import Facts
from cosim.quantities import (
    CHANNEL_QUANTITIES,
    DAMPERS,
    DRIVER,
    ESTIMATE,
    ESTIMATE_DEVIATION,
    POSE,
    RIDE,
    TRUTH,
    Quantity,
)

VEHICLE: Final[dict[str, tuple[tuple[Quantity, ...], str]]] = {
    "sensor channels": (CHANNEL_QUANTITIES, "output"),
    "true suspension velocities": (TRUTH, "output"),
    "position": (POSE, "output"),
    "ride": (RIDE, "output"),
    "driver": (DRIVER, "input"),
    "damper commands": (DAMPERS, "input"),
}
SENSOR: Final[dict[str, tuple[tuple[Quantity, ...], str]]] = {
    "sensor channels": (CHANNEL_QUANTITIES, "input"),
    "damper commands": (DAMPERS, "input"),
    "estimates": (ESTIMATE, "output"),
    "their deviations": (ESTIMATE_DEVIATION, "output"),
}


def service(description: Description) -> dict[str, dict[str, str]]:
    """Say of every quantity of the test bench whether the FMU has it under its own name.

    An FMU that takes channels in is asked for what a sensor needs, any other for what a vehicle
    needs.
    """
    units = {unit.name: unit for unit in description.units}
    groups = SENSOR if _is_sensor(description) else VEHICLE
    found = {
        group: {q.name: _answer(q, causality, description, units) for q in quantities}
        for group, (quantities, causality) in groups.items()
    }
    if groups is VEHICLE:
        return found
    return {group: _unconverted(answers) for group, answers in found.items()}


def _unconverted(answers: dict[str, str]) -> dict[str, str]:
    """A sensor's units are not converted, as a vehicle's are."""
    return {name: a.replace("yes, converted from", "is in") for name, a in answers.items()}


def _is_sensor(description: Description) -> bool:
    """Whether most channels are inputs of the FMU."""
    known = description.by_name
    inputs = [
        q.name for q in CHANNEL_QUANTITIES if q.name in known and known[q.name].causality == "input"
    ]
    return 2 * len(inputs) > len(CHANNEL_QUANTITIES)


def _answer(q: Quantity, causality: str, description: Description, units: dict[str, Unit]) -> str:
    v = description.by_name.get(q.variable)
    if v is None:
        hint = did_you_mean(q.variable, [o.name for o in description.variables
                                         if o.causality == causality])  # fmt: skip
        return f"missing{hint}"
    if v.causality != causality:
        return f"is of causality {v.causality}"
    if v.unit is None:
        return "yes, without a unit"
    wanted = readings(q.unit)[0].exponents
    unit = units.get(v.unit)
    found = None
    if unit is not None and unit.exponents is not None:
        found = tuple(unit.exponents[d] for d in DIMENSIONS)
    if found is not None and found[:7] != wanted[:7]:
        return f"of another kind: {v.unit} instead of {q.unit}"
    return "yes" if v.unit == q.unit else f"yes, converted from {v.unit}"


def show_service(facts: Facts) -> None:
    """Add a table of what the FMU has, and what it cannot do, to its facts."""
    rows, wrong = [], []
    for group, answers in facts.data["serves"].items():
        have = [a for a in answers.values() if a.startswith("yes")]
        rows.append((group, f"{len(have)} of {len(answers)}", _lacking(answers)))
        wrong += [f"{n} {a}" for n, a in answers.items() if a.startswith(("of", "is"))]
    facts.table("Serves the test bench under its own names", ("what", "has", "lacks"), rows)
    facts.notes += wrong
    sensor = "estimates" in facts.data["serves"]
    lacks = any(not a.startswith("yes") for g in facts.data["serves"].values() for a in g.values())
    if lacks and not sensor:
        facts.notes.append("other names are mapped by vehicle.variables of a scenario")


def _lacking(answers: dict[str, str]) -> str:
    return listed([n for n, a in answers.items() if not a.startswith("yes")], 6)
