"""The parts of a model description: variables, units, entries of ModelStructure; XML's numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

FLOATS: Final = ("Real", "Float64", "Float32")


@dataclass(frozen=True)
class Variable:
    """A variable with the attributes of its declared type filled in.

    `starts` is the start value as written, one text to an element of an array, None without one;
    `size` the number of elements, None where a structural parameter leaves it open.
    """

    name: str
    reference: int | None
    index: int
    line: int
    type: str
    causality: str
    variability: str
    initial: str | None
    description: str
    starts: tuple[str, ...] | None = None
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    unit: str | None = None
    display_unit: str | None = None
    declared_type: str | None = None
    derivative: int | None = None
    size: int | None = 1
    clocked: bool = False
    aliases: tuple[tuple[str, str | None, int], ...] = ()  # name, display unit, line

    @property
    def is_float(self) -> bool:
        """Whether its values are floating-point numbers."""
        return self.type in FLOATS

    @property
    def start(self) -> str | None:
        """The first start value as written."""
        return self.starts[0] if self.starts else None


@dataclass(frozen=True)
class Unit:
    """A unit: SI value = factor * value + offset; `exponents` None without a BaseUnit."""

    name: str
    line: int
    exponents: dict[str, int] | None
    factor: float
    offset: float
    display: tuple[DisplayUnit, ...]


@dataclass(frozen=True)
class DisplayUnit:
    """A unit for people: shown value = factor * value + offset, of the inverse if `inverse`."""

    name: str
    line: int
    factor: float
    offset: float
    inverse: bool


@dataclass(frozen=True)
class Unknown:
    """An entry of ModelStructure: of which list, and the variable by index (2) or reference (3)."""

    kind: str
    key: int | None
    line: int
    dependencies: tuple[int | None, ...] | None
    kinds: tuple[str, ...] | None


def truth(text: str | None) -> bool:
    """Return an xs:boolean, false if there is none."""
    return text in ("true", "1")


def number(text: str | None) -> float | None:
    """Return an xs:double, None if it is missing or no number."""
    if text is None:
        return None
    plain = text.strip()
    if "_" in plain or plain.casefold() in ("infinity", "-infinity", "+infinity"):
        return None
    try:
        return float(plain)
    except ValueError:
        return None


def whole(text: str | None) -> int | None:
    """Return a whole number, None if it is missing or none."""
    try:
        return int(str(text))
    except ValueError:
        return None
