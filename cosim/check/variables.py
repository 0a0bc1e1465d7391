"""The variables of a model description: names, references, start values, ranges, attributes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from typing import Final

from cosim.check.archive import MODEL_DESCRIPTION
from cosim.check.description import Description
from cosim.check.finding import Finding, listed
from cosim.check.parts import Variable, number

# legal pairs of causality and variability with their values of initial; FMI 2.0.5, section 2.2.7
_ANY: Final = ("calculated", "approx", "exact")
LEGAL: Final = {
    **{
        (causality, variability): ("exact",)
        for causality in ("parameter", "structuralParameter")
        for variability in ("fixed", "tunable")
    },
    ("calculatedParameter", "fixed"): ("calculated", "approx"),
    ("calculatedParameter", "tunable"): ("calculated", "approx"),
    ("input", "discrete"): (None, "exact"),
    ("input", "continuous"): (None, "exact"),
    ("output", "constant"): ("exact",),
    ("output", "discrete"): _ANY,
    ("output", "continuous"): _ANY,
    ("local", "constant"): ("exact",),
    ("local", "fixed"): ("calculated", "approx"),
    ("local", "tunable"): ("calculated", "approx"),
    ("local", "discrete"): _ANY,
    ("local", "continuous"): _ANY,
    ("independent", "continuous"): (None,),
}
_NONDIGIT, _QUOTED = r"[A-Za-z_]", r"'(?:[^'\\]|\\.)+'"
_PART = rf"(?:{_NONDIGIT}\w*|{_QUOTED})(?:\[\d+(?:,\d+)*\])?"
_IDENTIFIER = rf"{_PART}(?:\.{_PART})*"
STRUCTURED: Final = re.compile(rf"(?:{_IDENTIFIER}|der\({_IDENTIFIER}(?:,\d+)?\))", re.ASCII)


def variable_findings(description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the variables, one at a time and among each other."""
    for variable in description.variables:
        for check in _EACH:
            yield from check(variable)
    yield from _names(description)
    yield from _references(description)
    yield from _types(description)
    yield from _descriptions(description)
    yield from _independent(description)


def place(variable: Variable) -> str:
    """Return where a variable stands."""
    return f"{MODEL_DESCRIPTION}:{variable.line}"


def with_unit(value: float | str, variable: Variable) -> str:
    """Return a value as people write it, with the variable's unit."""
    text = value if isinstance(value, str) else f"{value:.12g}"
    return f"{text} {variable.unit}" if variable.unit else text


# ---------------------------------------------------------------- one variable


def _range(v: Variable) -> Iterator[Finding]:
    if v.minimum is not None and v.maximum is not None and v.minimum > v.maximum:
        yield Finding(
            "min-above-max", place(v),
            f"{v.name}: min {with_unit(v.minimum, v)} is above max {with_unit(v.maximum, v)}",
        )  # fmt: skip
        return
    low = -math.inf if v.minimum is None else v.minimum
    high = math.inf if v.maximum is None else v.maximum
    for text in v.starts or ():
        value = number(text)
        if value is not None and not low <= value <= high and not math.isnan(value):
            bounds = f"{low:.12g} to {high:.12g}"
            yield Finding(
                "start-outside-range", place(v),
                f"{v.name}: start {with_unit(value, v)} is outside its range, "
                f"{with_unit(bounds, v)}",
            )  # fmt: skip
            return


def _finite(v: Variable) -> Iterator[Finding]:
    bad = {
        "min": v.minimum is not None and math.isnan(v.minimum),
        "max": v.maximum is not None and math.isnan(v.maximum),
        "nominal": v.nominal is not None and not math.isfinite(v.nominal),
        "start": v.is_float
        and any(not math.isfinite(number(text) or 0.0) for text in v.starts or ()),
    }
    for attribute, wrong in bad.items():
        if wrong:
            yield Finding("not-finite", place(v), f"{v.name}: {attribute} is not a finite number")


def _nominal(v: Variable) -> Iterator[Finding]:
    if v.nominal == 0:
        yield Finding(
            "nominal-zero", place(v),
            f"{v.name}: nominal is 0; solvers scale by it, so give the size that the variable "
            "usually has, or leave it out",
        )  # fmt: skip
    elif v.nominal is not None and v.nominal < 0:
        yield Finding(
            "nominal-negative", place(v),
            f"{v.name}: nominal is {v.nominal:g}; it is a size and must be positive",
        )  # fmt: skip


def _start(v: Variable) -> Iterator[Finding]:
    needs = v.initial in ("exact", "approx") or v.causality == "input"
    if needs and v.starts is None and v.type != "Clock":
        yield Finding(
            "start-missing", place(v),
            f"{v.name}: no start value; {'an input' if v.causality == 'input' else _role(v)} "
            "needs one",
        )  # fmt: skip
    if v.starts is not None and (v.initial == "calculated" or v.causality == "independent"):
        yield Finding(
            "start-not-allowed", place(v),
            f"{v.name}: start {v.start} is given, but the value is calculated "
            f"({_role(v)}); leave the start value out",
        )  # fmt: skip
    if v.starts is not None and v.size is not None and len(v.starts) not in (1, v.size):
        yield Finding(
            "start-count", place(v),
            f"{v.name}: {len(v.starts)} start values for {v.size} elements",
        )  # fmt: skip


def _role(v: Variable) -> str:
    return f"causality {v.causality}, initial {v.initial or 'none'}"


def _combination(v: Variable) -> Iterator[Finding]:
    legal = LEGAL.get((v.causality, v.variability))
    if v.type == "Clock":
        return
    if legal is None or v.initial not in legal:
        allowed = sorted(b for a, b in LEGAL if a == v.causality)
        hint = (
            f"with causality {v.causality}, variability is {' or '.join(allowed)}"
            if legal is None
            else f"initial may be {' or '.join(i or 'left out' for i in legal)}"
        )
        yield Finding(
            "illegal-combination", place(v),
            f"{v.name}: causality {v.causality} with variability {v.variability} and initial "
            f"{v.initial or 'none'} is not allowed; {hint}",
        )  # fmt: skip
    elif v.variability == "continuous" and not v.is_float:
        yield Finding(
            "illegal-combination", place(v),
            f"{v.name}: a variable of type {v.type} cannot be continuous; declare "
            "variability discrete",
        )  # fmt: skip


_EACH: Final[tuple[Callable[[Variable], Iterator[Finding]], ...]] = (
    _range, _finite, _nominal, _start, _combination,
)  # fmt: skip


# ---------------------------------------------------------------- all of them


def _names(description: Description) -> Iterator[Finding]:
    seen: dict[str, int] = {}
    for v in description.variables:
        for name, line in ((v.name, v.line), *((a, at) for a, _, at in v.aliases)):
            if name in seen:
                yield Finding(
                    "duplicate-name", f"{MODEL_DESCRIPTION}:{line}",
                    f"the name '{name}' is already that of the variable in line {seen[name]}",
                )  # fmt: skip
            seen.setdefault(name, line)
    structured = description.root.get("variableNamingConvention") == "structured"
    for name, line in seen.items():
        if any(ord(letter) < 32 for letter in name) or not name:
            yield Finding(
                "variable-name", f"{MODEL_DESCRIPTION}:{line}",
                f"the name {name!r} is empty or has control characters",
            )  # fmt: skip
        elif structured and not STRUCTURED.fullmatch(name):
            yield Finding(
                "variable-name", f"{MODEL_DESCRIPTION}:{line}",
                f"'{name}' is no name of the structured naming convention (a.b[1].c, der(a)); "
                "rename it or declare variableNamingConvention flat",
            )  # fmt: skip


def _references(description: Description) -> Iterator[Finding]:
    """FMI 3 wants each reference once. FMI 2 shares them among aliases, which must agree."""
    groups: dict[tuple[str, int], list[Variable]] = {}
    for v in description.variables:
        if v.reference is not None:
            kind = v.type if description.major == 2 else ""
            kind = "Integer" if kind == "Enumeration" else kind
            groups.setdefault((kind, v.reference), []).append(v)
    for (_, reference), group in groups.items():
        if len(group) < 2:
            continue
        conflict = "" if description.major == 3 else _alias_conflict(group)
        if description.major == 3 or conflict:
            yield Finding(
                "reference-conflict", place(group[1]),
                f"{listed(v.name for v in group)} share the value reference {reference}"
                + (f", but {conflict}" if conflict else "; FMI 3 wants each once"),
            )  # fmt: skip


def _alias_conflict(group: list[Variable]) -> str:
    units = {v.unit for v in group}
    if len(units) > 1:
        return f"have the units {' and '.join(sorted(u or 'none' for u in units))}"
    settable = [v for v in group if v.causality in ("input", "parameter", "structuralParameter")]
    if len(settable) > 1:
        return "more than one of them can be set"
    starts = {number(v.start) if v.is_float else v.start for v in group if v.starts}
    if len(starts) > 1:
        return f"start at {' and '.join(sorted(str(s) for s in starts))}"
    return ""


def _types(description: Description) -> Iterator[Finding]:
    for v in description.variables:
        if v.declared_type is not None and v.declared_type not in description.types:
            yield Finding(
                "type-undefined", place(v),
                f"{v.name}: its declaredType '{v.declared_type}' is not among the TypeDefinitions",
            )  # fmt: skip


def _descriptions(description: Description) -> Iterator[Finding]:
    bare = [v for v in description.variables if not v.description.strip()]
    public = [v for v in bare if v.causality not in ("local", "independent")]
    if public:
        yield Finding(
            "description-missing", place(public[0]),
            "parameters, inputs and outputs without a description: "
            f"{listed(v.name for v in public)}",
        )  # fmt: skip


def _independent(description: Description) -> Iterator[Finding]:
    times = [v.name for v in description.variables if v.causality == "independent"]
    if len(times) > 1 or (description.major == 3 and not times):
        yield Finding(
            "independent-variable", MODEL_DESCRIPTION,
            f"{len(times) or 'no'} variables are independent"
            f"{': ' + listed(times) if times else ''}; there must be exactly one, the time",
        )  # fmt: skip
