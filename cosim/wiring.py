"""Which FMU variable carries which quantity, and how its unit becomes ours.

An FMU states its units as base = factor * value + offset over the SI base units (FMI 2.0 and 3.0,
UnitDefinitions); that statement, not a table of ours, converts them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

from cosim.errors import Problem
from cosim.fmi import Description
from cosim.quantities import (
    INPUT_QUANTITIES,
    OUTPUT_QUANTITIES,
    QUANTITIES,
    Quantity,
)

_EXPONENTS: Final = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


class Mapped(Protocol):
    """What a scenario says of one quantity's variable."""

    @property
    def name(self) -> str:
        """Variable of the FMU."""

    @property
    def unit(self) -> str | None:
        """Its unit, where the FMU declares none."""

    @property
    def scale(self) -> float:
        """Factor after the unit conversion, such as -1 for another sign."""


class Report(Protocol):
    """Makes a problem out of a place in the scenario and a sentence."""

    def __call__(
        self,
        key: tuple[str | int, ...],
        message: str,
        choices: Sequence[str] = ...,
        name: str = ...,
    ) -> Problem:
        """Return the problem."""


@dataclass(frozen=True)
class Wire:
    """A quantity on a variable: quantity = factor * variable + offset."""

    quantity: Quantity
    variable: str
    factor: float
    offset: float


@dataclass(frozen=True)
class Wiring:
    """The wires of a vehicle FMU, in the order of the quantities."""

    outputs: tuple[Wire, ...]
    inputs: tuple[Wire, ...]


def own_wiring() -> Wiring:
    """Return the wiring of the package's own vehicle FMU, whose units are SI."""

    def wires(quantities: Iterable[Quantity]) -> tuple[Wire, ...]:
        return tuple(Wire(q, q.variable, q.scale, 0.0) for q in quantities)

    return Wiring(wires(OUTPUT_QUANTITIES), wires(INPUT_QUANTITIES))


def mapped_wiring(
    description: Description, mapping: Mapping[str, Mapped], report: Report
) -> tuple[Wiring, list[Problem]]:
    """Wire another FMU by the scenario's map; quantities it does not name keep our variable names.

    Returns the wiring and every problem found: unknown quantities and variables, wrong causality or
    type, units that are undefined or of another dimension, and missing required quantities.
    """
    problems = [
        report(
            ("vehicle", "variables", name), f"unknown quantity '{name}'", tuple(QUANTITIES), name
        )
        for name in mapping
        if name not in QUANTITIES
    ]

    def wires(quantities: Iterable[Quantity], causality: tuple[str, ...]) -> tuple[Wire, ...]:
        found = (_wire(description, q, mapping.get(q.name), causality, report) for q in quantities)
        kept = []
        for item in found:
            if isinstance(item, Problem):
                problems.append(item)
            elif item is not None:
                kept.append(item)
        return tuple(kept)

    outputs = wires(OUTPUT_QUANTITIES, ("output", "local", "calculatedParameter"))
    inputs = wires(INPUT_QUANTITIES, ("input",))
    problems += _doubled(inputs, report)
    return Wiring(outputs, inputs), problems


def _doubled(inputs: Sequence[Wire], report: Report) -> list[Problem]:
    """Return a problem for each input variable that two quantities would write."""
    first: dict[str, str] = {}
    problems = []
    for wire in inputs:
        other = first.setdefault(wire.variable, wire.quantity.name)
        if other != wire.quantity.name:
            sentence = f"'{wire.variable}' is mapped from both {other} and {wire.quantity.name}"
            problems.append(report(("vehicle", "variables", wire.quantity.name, "name"), sentence))
    return problems


def _wire(
    description: Description,
    quantity: Quantity,
    mapped: Mapped | None,
    causality: tuple[str, ...],
    report: Report,
) -> Wire | Problem | None:
    key = ("vehicle", "variables", quantity.name, "name")
    name = mapped.name if mapped is not None else quantity.variable
    variable = description.variables.get(name)
    if variable is None:
        if mapped is None:
            if not quantity.required:
                return None
            sentence = f"the FMU has no variable for {quantity.name} [{quantity.unit}]; map it"
            return report(("vehicle", "variables", quantity.name), sentence)
        sentence = f"'{description.path.name}' has no variable '{name}'"
        return report(key, sentence, tuple(description.variables), name)
    if variable.causality not in causality:
        return report(
            key, f"'{name}' is {variable.causality}; {quantity.name} needs {causality[0]}"
        )
    if variable.type not in ("Real", "Float64"):
        return report(
            key, f"'{name}' is of type {variable.type}; {quantity.name} needs real numbers"
        )
    if getattr(variable, "dimensions", None):
        return report(key, f"'{name}' is an array; {quantity.name} needs one number")
    return _converted(description, quantity, mapped, name, report)


def _converted(
    description: Description,
    quantity: Quantity,
    mapped: Mapped | None,
    name: str,
    report: Report,
) -> Wire | Problem:
    declared = description.unit_of(name)
    stated = mapped.unit if mapped is not None else None
    unit = stated or declared
    scale = mapped.scale if mapped is not None else quantity.scale
    key = ("vehicle", "variables", quantity.name, "unit")
    if scale == 0:
        return report((*key[:-1], "scale"), f"the scale of {quantity.name} must not be 0")
    if stated and declared and stated != declared:
        return report(key, f"the FMU declares '{name}' in {declared}, not in {stated}")
    definition = description.units.get(unit) if unit else None
    if definition is None or definition.baseUnit is None:
        if unit is None or unit == quantity.unit or (mapped is not None and scale != 1):
            return Wire(quantity, name, scale, 0.0)
        sentence = (
            f"the FMU does not define the unit {unit} of '{name}': give scale, its factor to "
            f"{quantity.unit}"
        )
        return report(key, sentence)
    base = definition.baseUnit
    if base.factor == 0 or not _same_dimension(base, str(unit), quantity.unit):
        return report(
            key, f"'{name}' is in {unit}, which is no unit of {quantity.name} [{quantity.unit}]"
        )
    return Wire(quantity, name, scale * base.factor, scale * base.offset)


DIMENSIONS: Final[dict[str, dict[str, int]]] = {
    "1": {}, "m": {"m": 1}, "m/s": {"m": 1, "s": -1}, "m/s2": {"m": 1, "s": -2}, "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1}, "N": {"kg": 1, "m": 1, "s": -2},
}  # fmt: skip


def _same_dimension(base: Any, unit: str, wanted: str) -> bool:
    """Compare SI exponents. Many tools leave the radian's out, so an angle's unit may tell by its
    name.
    """
    expected = DIMENSIONS[wanted]
    found = {name: getattr(base, name, 0) or 0 for name in _EXPONENTS}
    if expected.get("rad") and not found["rad"] and re.search(r"rad|deg|grad|°|rpm", unit):
        found["rad"] = expected["rad"]
    return all(found[name] == expected.get(name, 0) for name in _EXPONENTS)
