"""The variable table of a model: reads ``variables.toml`` and checks it.

A name holding ``@`` stands for four variables, one to a corner, and becomes an array of four in C.
"""

import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

from structure import initial_dependencies
from table import (
    CORNERS,
    FIRST_REFERENCE,
    DisplayUnit,
    Field,
    Start,
    Table,
    TypeDefinition,
    Unit,
    Variable,
)

BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
LAYER_CATEGORIES = (
    ("logStatusError", "A call failed; the message says why"),
    ("logStatusWarning", "A call succeeded with something the user should know"),
)
VARIABILITIES = {
    "parameter": ("fixed", "tunable"),
    "input": ("continuous", "discrete"),
    "output": ("continuous", "discrete"),
}
TABLES = {"model", "units", "types", "group", "terminals", "initial"}
MODEL_KEYS = {
    "name", "identifier", "description", "author", "license", "log_categories",
    "step_size", "stop_time", "language", "needs",
}  # fmt: skip
VARIABLE_KEYS = {
    "name", "type", "unit", "display", "quantity", "description", "start", "min", "max", "nominal",
    "causality", "variability", "missing",
}  # fmt: skip


class TableError(Exception):
    """Everything wrong with a variable table, one sentence to a line."""


def field_name(name: str) -> str:
    """C name of a variable: ``Car.C@.q0`` -> ``Car_C_q0``."""
    return re.sub("_+", "_", name.replace("@", "").replace(".", "_")).strip("_")


def _unknown(where: str, given: set[str], known: set[str]) -> list[str]:
    return [f"{where}: unknown key '{key}'" for key in sorted(given - known)]


def _read_unit(name: str, raw: dict[str, Any], problems: list[str]) -> Unit:
    problems += _unknown(f"unit '{name}'", set(raw), {"base", "factor", "display"})
    problems += [
        f"unit '{name}': '{key}' is not an SI base unit"
        for key in raw.get("base", {})
        if key not in BASE_UNITS
    ]
    display = [
        DisplayUnit(d["name"], float(d.get("factor", 1.0)), float(d.get("offset", 0.0)))
        for d in raw.get("display", [])
    ]
    return Unit(name, raw.get("base", {}), float(raw.get("factor", 1.0)), tuple(display))


def _starts(raw: dict[str, Any], kind: str, count: int, problems: list[str]) -> list[Start]:
    """Start values of the scalars of one entry, in the type of the variable."""
    types = {"Float64": (int, float), "Boolean": (bool,), "String": (str,)}[kind]
    start = raw.get("start", {"Float64": 0.0, "Boolean": False, "String": ""}[kind])
    values = start if isinstance(start, list) else [start] * count
    if len(values) != count:
        problems.append(f"{raw['name']}: {len(values)} start values for {count} variables")
        values = [values[0]] * count
    bad = [v for v in values if not isinstance(v, types) or (kind == "Float64" and v is True)]
    if bad:
        problems.append(f"{raw['name']}: start value {bad[0]!r} is not of type {kind}")
        values = [types[-1]() for _ in values]
    return [float(v) for v in values] if kind == "Float64" else values


def _check(variable: Variable, units: dict[str, Unit], raw: dict[str, Any]) -> list[str]:
    """What is wrong with one variable."""
    name, problems = variable.name, []
    if variable.variability not in VARIABILITIES.get(variable.causality, ()):
        problems.append(
            f"{name}: causality '{variable.causality}' with variability '{variable.variability}'"
        )
    if variable.causality == "output" and "start" in raw:
        problems.append(f"{name}: an output is calculated and has no start value")
    if not variable.description:
        problems.append(f"{name}: no description")
    if variable.can_be_missing and (variable.type, variable.causality) != ("Float64", "input"):
        problems.append(f"{name}: only an input of type Float64 can be missing")
    if variable.type != "Float64":
        return problems
    if variable.unit not in units:
        problems.append(f"{name}: unit '{variable.unit}' is not defined in [units]")
    elif variable.display not in ["", *(d.name for d in units[variable.unit].display)]:
        problems.append(
            f"{name}: display unit '{variable.display}' is not one of unit '{variable.unit}'"
        )
    if not variable.minimum <= variable.maximum:
        problems.append(f"{name}: min {variable.minimum} is above max {variable.maximum}")
    has_start = variable.causality != "output"
    if has_start and not variable.minimum <= float(variable.start) <= variable.maximum:
        problems.append(
            f"{name}: start {variable.start} {variable.unit} is outside"
            f" {variable.minimum} to {variable.maximum} {variable.unit}"
        )
    return problems


def _expand(raw: dict[str, Any], problems: list[str]) -> tuple[Field, list[Variable]]:
    """One entry of the table: its C field and its one or four variables."""
    name, kind = raw["name"], raw.get("type", "Float64")
    problems += _unknown(name, set(raw), VARIABLE_KEYS)
    if kind not in FIRST_REFERENCE:
        problems.append(f"{name}: type '{kind}' is none of {', '.join(FIRST_REFERENCE)}")
        kind = "Float64"
    causality = raw.get("causality", "")
    natural = VARIABILITIES.get(causality, ("",))[0]
    if kind != "Float64" and natural == "continuous":
        natural = "discrete"
    corners = CORNERS if "@" in name else ("",)
    starts = _starts(raw, kind, len(corners), problems)
    description = raw.get("description", "")
    c_name = field_name(name)
    variables = [
        Variable(
            name=name.replace("@", corner),
            type=kind,
            causality=causality,
            variability=raw.get("variability", natural),
            description=description.replace("@", corner),
            start=start,
            field=f"{c_name}[{i}]" if corner else c_name,
            unit=raw.get("unit", ""),
            display=raw.get("display", ""),
            quantity=raw.get("quantity", ""),
            minimum=float(raw.get("min", -math.inf)),
            maximum=float(raw.get("max", math.inf)),
            nominal=raw.get("nominal"),
            can_be_missing=raw.get("missing", False),
        )
        for i, (corner, start) in enumerate(zip(corners, starts, strict=True))
    ]
    comment = f"{description} [{raw['unit']}]" if "unit" in raw else description
    return Field(c_name, kind, len(corners), comment), variables


def _repeated(names: list[str], what: str) -> list[str]:
    twice = sorted({name for name in names if names.count(name) > 1})
    return [f"{name}: this {what} appears twice" for name in twice]


def _read_model(raw: dict[str, Any], problems: list[str]) -> dict[str, Any]:
    problems += _unknown("[model]", set(raw), MODEL_KEYS)
    problems += [
        f"[model]: no '{key}'" for key in ("name", "identifier", "description") if key not in raw
    ]
    categories = [tuple(c) for c in raw.get("log_categories", [])]
    own = {name for name, _ in categories}
    categories = [c for c in LAYER_CATEGORIES if c[0] not in own] + categories
    defaults = {"step_size": 0.01, "stop_time": 10.0, "language": "C11", "needs": ""}
    return {**defaults, **raw, "log_categories": categories}


def _read_types(
    raw: dict[str, Any], units: dict[str, Unit], problems: list[str]
) -> tuple[TypeDefinition, ...]:
    """Type definitions; once there are any, every unit has one."""
    types = tuple(
        TypeDefinition(name, t.get("unit", ""), float(t["nominal"]) if "nominal" in t else None)
        for name, t in raw.items()
    )
    for name, definition in raw.items():
        problems += _unknown(f"type '{name}'", set(definition), {"unit", "nominal"})
    of_type = [definition.unit for definition in types]
    problems += [
        f"type '{d.name}': unit '{d.unit}' is not defined in [units]"
        for d in types
        if d.unit not in units
    ]
    problems += _repeated(of_type, "unit of a type")
    problems += [
        f"unit '{name}': no type in [types] has it"
        for name in units
        if types and name not in of_type
    ]
    return types


def _finish(variables: list[Variable], types: tuple[TypeDefinition, ...]) -> tuple[Variable, ...]:
    """Types by their units, and value references: counted up within each type of value."""
    following = dict(FIRST_REFERENCE)
    declared = {definition.unit: definition.name for definition in types}
    finished = []
    for v in variables:
        own = declared.get(v.unit, "") if v.type == "Float64" else ""
        finished.append(replace(v, reference=following[v.type], declared_type=own))
        following[v.type] += 1
    return tuple(finished)


def read_table(path: Path) -> Table:
    """Read and check ``variables.toml``; raises TableError with all problems at once."""
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise TableError(f"{path}: {error}") from error
    problems = _unknown(path.name, set(raw), TABLES)
    model = _read_model(raw.get("model", {}), problems)
    units = {n: _read_unit(n, u, problems) for n, u in raw.get("units", {}).items()}
    units.setdefault("s", Unit("s", {"s": 1}, 1.0, ()))  # of the independent variable
    types = _read_types(raw.get("types", {}), units, problems)
    fields, variables = [], []
    for group in raw.get("group", []):
        common = {key: value for key, value in group.items() if key != "variables"}
        for entry in group["variables"]:
            merged = {**common, **entry}
            new_field, expanded = _expand(merged, problems)
            fields.append(new_field)
            variables += expanded
            for variable in expanded:
                problems += _check(variable, units, merged)
    problems += _repeated([*(v.name for v in variables), *(d.name for d in types)], "name")
    problems += _repeated([f.name for f in fields], "C name")
    terminals = raw.get("terminals", {})
    names = {v.name for v in variables}
    problems += [
        f"terminal '{t}': there is no variable '{n}'"
        for t, terminal in terminals.items()
        for n in terminal.get("members", [])
        if n not in names
    ]
    outputs = [v.name for v in variables if v.causality == "output"]
    knowns = [v.name for v in variables if v.causality != "output"]
    initial = initial_dependencies(raw.get("initial", {}), outputs, knowns, problems)
    if problems:
        raise TableError("\n".join(f"{path}: {p}" for p in problems))
    table = Table(model, tuple(units.values()), tuple(fields), _finish(variables, types))
    return replace(table, types=types, terminals=terminals, initial=initial)
