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
    """The wires of an FMU, in the order of the quantities."""

    outputs: tuple[Wire, ...]
    inputs: tuple[Wire, ...]


@dataclass(frozen=True)
class Interface:
    """The quantities that an FMU gives and takes; `key` is the path of the part of the scenario
    that names it, where its map is the field `variables`.
    """

    key: tuple[str | int, ...]
    outputs: tuple[Quantity, ...]
    inputs: tuple[Quantity, ...]

    def place(self, *field: str) -> tuple[str | int, ...]:
        """Return the path of a quantity's entry in the map, or of a field of that."""
        return (*self.key, "variables", *field)


VEHICLE: Final = Interface(("vehicle",), OUTPUT_QUANTITIES, INPUT_QUANTITIES)


def own_wiring() -> Wiring:
    """Return the wiring of the package's own vehicle FMU, whose units are SI."""

    def wires(quantities: Iterable[Quantity]) -> tuple[Wire, ...]:
        return tuple(Wire(q, q.variable, q.scale, 0.0) for q in quantities)

    return Wiring(wires(OUTPUT_QUANTITIES), wires(INPUT_QUANTITIES))


def mapped_wiring(
    description: Description,
    mapping: Mapping[str, Mapped],
    report: Report,
    interface: Interface = VEHICLE,
) -> tuple[Wiring, list[Problem]]:
    """Wire another FMU by the scenario's map; quantities it does not name keep our variable names.

    Returns the wiring and every problem found: unknown quantities and variables, wrong causality or
    type, units that are undefined or of another dimension, and missing required quantities.
    """
    known = tuple(q.name for q in (*interface.outputs, *interface.inputs))
    problems = [
        report(interface.place(name), f"unknown quantity '{name}'", known, name)
        for name in mapping
        if name not in known
    ]
    search = _Search(description, mapping, report, interface)

    def wires(quantities: Iterable[Quantity], causality: tuple[str, ...]) -> tuple[Wire, ...]:
        found = (search.wire(q, causality) for q in quantities)
        kept = []
        for item in found:
            if isinstance(item, Problem):
                problems.append(item)
            elif item is not None:
                kept.append(item)
        return tuple(kept)

    outputs = wires(interface.outputs, ("output", "local", "calculatedParameter"))
    inputs = wires(interface.inputs, ("input",))
    problems += search.doubled(inputs)
    return Wiring(outputs, inputs), problems


@dataclass(frozen=True)
class _Search:
    """Looks for the variables of an FMU that carry quantities."""

    description: Description
    mapping: Mapping[str, Mapped]
    report: Report
    interface: Interface

    def doubled(self, inputs: Sequence[Wire]) -> list[Problem]:
        """Return a problem for each input variable that two quantities would write."""
        first: dict[str, str] = {}
        problems = []
        for wire in inputs:
            name = wire.quantity.name
            other = first.setdefault(wire.variable, name)
            if other != name:
                sentence = f"'{wire.variable}' is mapped from both {other} and {name}"
                problems.append(self.report(self.interface.place(name, "name"), sentence))
        return problems

    def wire(self, quantity: Quantity, causality: tuple[str, ...]) -> Wire | Problem | None:
        """Return the wire of a quantity, what is wrong with it, or None where it has none."""
        mapped, report = self.mapping.get(quantity.name), self.report
        key = self.interface.place(quantity.name, "name")
        name = mapped.name if mapped is not None else quantity.variable
        variable = self.description.variables.get(name)
        if variable is None:
            if mapped is None:
                if not quantity.required:
                    return None
                sentence = f"the FMU has no variable for {quantity.name} [{quantity.unit}]; map it"
                return report(key[:-1], sentence)
            sentence = f"'{self.description.path.name}' has no variable '{name}'"
            return report(key, sentence, tuple(self.description.variables), name)
        if variable.causality not in causality:
            return report(
                key, f"'{name}' is {variable.causality}; {quantity.name} needs {causality[0]}"
            )
        wanted = ("Boolean",) if quantity.boolean else ("Real", "Float64")
        if variable.type not in wanted:
            needs = "true or false" if quantity.boolean else "real numbers"
            sentence = f"'{name}' is of type {variable.type}; {quantity.name} needs {needs}"
            return report(key, sentence)
        if getattr(variable, "dimensions", None):
            single = "value" if quantity.boolean else "number"
            return report(key, f"'{name}' is an array; {quantity.name} needs one {single}")
        return self._plain(quantity, name) if quantity.boolean else self._converted(quantity, name)

    def _plain(self, quantity: Quantity, name: str) -> Wire | Problem:
        mapped = self.mapping.get(quantity.name)
        if mapped is not None and (mapped.unit is not None or mapped.scale != 1):
            sentence = f"{quantity.name} is true or false; leave its unit and scale out"
            return self.report(self.interface.place(quantity.name), sentence)
        return Wire(quantity, name, 1.0, 0.0)

    def _converted(self, quantity: Quantity, name: str) -> Wire | Problem:
        mapped, report = self.mapping.get(quantity.name), self.report
        declared = self.description.unit_of(name)
        stated = mapped.unit if mapped is not None else None
        unit = stated or declared
        scale = mapped.scale if mapped is not None else quantity.scale
        key = self.interface.place(quantity.name, "unit")
        if scale == 0:
            return report((*key[:-1], "scale"), f"the scale of {quantity.name} must not be 0")
        if stated and declared and stated != declared:
            return report(key, f"the FMU declares '{name}' in {declared}, not in {stated}")
        definition = self.description.units.get(unit) if unit else None
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
