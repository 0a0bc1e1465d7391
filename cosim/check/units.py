"""Unit definitions against the meaning of their names, and the units that variables use."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import Final

from cosim.check.archive import MODEL_DESCRIPTION
from cosim.check.description import Description
from cosim.check.finding import Finding, listed
from cosim.check.parts import DisplayUnit, Unit
from cosim.check.unit_names import DIMENSIONS, Exponents, Reading, readings
from cosim.check.variables import place
from cosim.errors import did_you_mean

TOLERANCE: Final = 2e-3  # relative: 9.81 passes for standard gravity, 57.3 for 180 over pi
_OFFSET_TOLERANCE: Final = 0.02  # as part of one unit


def unit_findings(description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the units."""
    for unit in description.units:
        yield from _definition(unit)
        for display in unit.display:
            yield from _display(unit, display)
    for name, count in Counter(unit.name for unit in description.units).items():
        if count > 1:
            line = [unit.line for unit in description.units if unit.name == name][1]
            yield Finding("duplicate-unit", _where(line), f"unit '{name}' is defined {count} times")
    yield from _used(description)


def _where(line: int) -> str:
    return f"{MODEL_DESCRIPTION}:{line}"


def _definition(unit: Unit) -> Iterator[Finding]:
    meanings = readings(unit.name)
    if unit.exponents is None:
        if meanings and any(any(m.exponents) or m.factor != 1 for m in meanings):
            yield Finding(
                "unit-without-base", _where(unit.line),
                f"unit '{unit.name}' has no BaseUnit; no tool can convert it",
            )  # fmt: skip
        return
    declared = _declared(unit)
    if unit.factor == 0 or not math.isfinite(unit.factor):
        yield Finding(
            "unit-factor", _where(unit.line), f"unit '{unit.name}': factor {unit.factor:g}"
        )
        return
    if not meanings or any(_agree(declared, meaning) for meaning in meanings):
        return
    alike = [m for m in meanings if m.same_kind(declared.exponents)]
    if not alike:
        yield Finding(
            "unit-exponents", _where(unit.line),
            f"unit '{unit.name}' is defined as {_si(declared.exponents)}, but its name means "
            f"{_si(meanings[0].exponents)}; mend the BaseUnit or the name",
        )  # fmt: skip
        return
    right = min(alike, key=lambda m: abs(math.log(abs(m.factor / declared.factor))))
    if not _close(declared.factor, right.factor):
        ratio = max(declared.factor / right.factor, right.factor / declared.factor)
        yield Finding(
            "unit-factor", _where(unit.line),
            f"unit '{unit.name}': factor {declared.factor:.10g}, but by its name it is "
            f"{right.factor:.10g} {_si(right.exponents)}; every value is wrong by a factor of "
            f"{ratio:.6g}",
        )  # fmt: skip
    else:
        yield Finding(
            "unit-offset", _where(unit.line),
            f"unit '{unit.name}': offset {declared.offset:.8g}, but by its name it is "
            f"{right.offset:.8g} {_si(right.exponents)}",
        )  # fmt: skip


def _display(unit: Unit, display: DisplayUnit) -> Iterator[Finding]:
    """A shown value is (factor u + offset - display offset) / display factor, all in SI."""
    meanings = readings(display.name)
    own = readings(unit.name) or (() if unit.exponents is None else (_declared(unit),))
    if not meanings or not own or display.inverse:
        return
    expected = [
        Reading(u.factor / d.factor, d.exponents, (u.offset - d.offset) / d.factor)
        for u in own
        for d in meanings
        if d.same_kind(u.exponents)
    ]
    given = Reading(display.factor, meanings[0].exponents, display.offset)
    where = _where(display.line)
    if not expected:
        yield Finding(
            "display-unit-exponents", where,
            f"display unit '{display.name}' of '{unit.name}' measures something else: "
            f"{_si(meanings[0].exponents)}, not {_si(own[0].exponents)}",
        )  # fmt: skip
        return
    if any(_close(given.factor, e.factor) and _near(given.offset, e.offset) for e in expected):
        return
    right = expected[0]
    if not any(_close(given.factor, e.factor) for e in expected):
        inverse = _close(given.factor, 1 / right.factor)
        yield Finding(
            "display-unit-factor", where,
            f"display unit '{display.name}' of '{unit.name}': factor {given.factor:.10g}, but "
            f"1 {unit.name} is {right.factor:.10g} {display.name}"
            + ("; the factor is upside down" if inverse else ""),
        )  # fmt: skip
    else:
        yield Finding(
            "display-unit-offset", where,
            f"display unit '{display.name}' of '{unit.name}': offset {given.offset:.8g}, but "
            f"0 {unit.name} is {right.offset:.8g} {display.name}",
        )  # fmt: skip


def _used(description: Description) -> Iterator[Finding]:
    defined = {unit.name: [d.name for d in unit.display] for unit in description.units}
    bare: list[str] = []
    for v in description.variables:
        if v.unit is not None and v.unit not in defined:
            yield Finding(
                "unit-undefined", place(v),
                f"{v.name}: its unit '{v.unit}' is not among the UnitDefinitions"
                f"{did_you_mean(v.unit, defined)}",
            )  # fmt: skip
        for name, shown in ((v.name, v.display_unit), *((a, d) for a, d, _ in v.aliases)):
            known = [*defined.get(v.unit or "", []), v.unit]
            if shown is not None and shown not in known and (v.unit is None or v.unit in defined):
                yield Finding(
                    "display-unit-undefined", place(v),
                    f"{name}: its display unit '{shown}' is not one of the unit '{v.unit}'"
                    + (f"; {v.unit} has {listed(defined[v.unit])}"
                       if v.unit and defined[v.unit] else ""),
                )  # fmt: skip
        if v.is_float and v.unit is None and v.causality in ("input", "output"):
            bare.append(v.name)
    if bare:
        yield Finding(
            "unit-missing", MODEL_DESCRIPTION,
            f"real inputs and outputs without a unit: {listed(bare)}; write '1' for a plain number",
        )  # fmt: skip


def _declared(unit: Unit) -> Reading:
    exponents = unit.exponents or {}
    return Reading(
        unit.factor,
        tuple(exponents.get(d, 0) for d in DIMENSIONS),
        unit.offset,
    )


def _agree(a: Reading, b: Reading) -> bool:
    return a.same_kind(b.exponents) and _close(a.factor, b.factor) and _offsets(a, b)


def _offsets(a: Reading, b: Reading) -> bool:
    return abs(a.offset - b.offset) <= _OFFSET_TOLERANCE * abs(b.factor)


def _close(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=TOLERANCE)


def _near(a: float, b: float) -> bool:
    return abs(a - b) <= _OFFSET_TOLERANCE


def _si(exponents: Exponents) -> str:
    parts = [
        name if power == 1 else f"{name}^{power}"
        for name, power in zip(DIMENSIONS, exponents, strict=True)
        if power
    ]
    return " ".join(parts) or "1"
