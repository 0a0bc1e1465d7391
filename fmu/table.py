"""A model's variable table: units, types, variables, C fields, terminals.

``variables.py`` reads it from ``variables.toml``; descriptions and C code are written from it.
"""

import math
from dataclasses import dataclass, field
from typing import Any

CORNERS = ("FL", "FR", "RL", "RR")
FIRST_REFERENCE = {"Float64": 0, "Boolean": 100_000, "String": 200_000}
TIME_REFERENCE = 999_999
STRING_SIZE = 1024

Start = float | bool | str


@dataclass(frozen=True)
class DisplayUnit:
    """A unit for people: value in it = factor * SI value + offset."""

    name: str
    factor: float
    offset: float


@dataclass(frozen=True)
class Unit:
    """A unit by its SI exponents: SI value = factor * value."""

    name: str
    base: dict[str, int]
    factor: float
    display: tuple[DisplayUnit, ...]


@dataclass(frozen=True)
class TypeDefinition:
    """A physical quantity: its unit and, where that is not 1, a typical size in it."""

    name: str
    unit: str
    nominal: float | None


@dataclass(frozen=True)
class Variable:
    """One scalar variable, as an FMU shows it."""

    name: str
    type: str
    causality: str
    variability: str
    description: str
    start: Start
    field: str  # how C addresses it inside Variables: "Car_ax" or "Car_Fz[2]"
    reference: int = 0
    unit: str = ""
    display: str = ""
    quantity: str = ""
    minimum: float = -math.inf
    maximum: float = math.inf
    nominal: float | None = None
    declared_type: str = ""
    can_be_missing: bool = False  # an input that is NaN or infinite where there is no value


@dataclass(frozen=True)
class Field:
    """One member of the C struct ``Variables``."""

    name: str
    type: str
    count: int  # 4 for an array over the corners, else 1
    comment: str


@dataclass(frozen=True)
class Table:
    """A whole ``variables.toml``."""

    model: dict[str, Any]
    units: tuple[Unit, ...]
    fields: tuple[Field, ...]
    variables: tuple[Variable, ...]
    types: tuple[TypeDefinition, ...] = ()
    terminals: dict[str, dict[str, Any]] = field(default_factory=dict)
    initial: dict[str, list[str]] = field(default_factory=dict)  # see structure.py

    def of_type(self, kind: str) -> list[Variable]:
        """Variables of one type, in the order of their value references."""
        return [v for v in self.variables if v.type == kind]

    def of_causality(self, causality: str) -> list[Variable]:
        """Variables of one causality, in the order of the table."""
        return [v for v in self.variables if v.causality == causality]
