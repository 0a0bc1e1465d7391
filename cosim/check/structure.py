"""ModelStructure: every output and initial unknown listed, and nothing that does not exist.

FMI 2.0.5, section 2.2.8; FMI 3.0, section 2.4.8.
"""

from __future__ import annotations

from collections.abc import Iterator

from cosim.check.archive import MODEL_DESCRIPTION
from cosim.check.description import Description
from cosim.check.finding import Finding, listed
from cosim.check.parts import Unknown, Variable

OUTPUTS = ("Outputs", "Output")
INITIAL_UNKNOWNS = ("InitialUnknowns", "InitialUnknown")
DERIVATIVES = ("Derivatives", "ContinuousStateDerivative")


def structure_findings(description: Description) -> Iterator[Finding]:
    """Yield what is wrong with ModelStructure."""
    known = _by_key(description)
    for unknown in description.unknowns:
        yield from _references(unknown, known, description.major)
        yield from _kinds(unknown)
    yield from _outputs(description, known)
    yield from _initial(description, known)


def _by_key(description: Description) -> dict[int | None, Variable]:
    if description.major == 2:
        return {v.index: v for v in description.variables}
    return {v.reference: v for v in description.variables}


def _where(line: int) -> str:
    return f"{MODEL_DESCRIPTION}:{line}"


def _references(
    unknown: Unknown, known: dict[int | None, Variable], major: int
) -> Iterator[Finding]:
    what = "index" if major == 2 else "valueReference"
    last = f"; there are {max((k or 0 for k in known), default=0)} variables" if major == 2 else ""
    if unknown.key is not None and unknown.key not in known:
        yield Finding(
            "structure-unknown-variable", _where(unknown.line),
            f"ModelStructure/{unknown.kind} names {what} {unknown.key}, which no variable "
            f"has{last}",
        )  # fmt: skip
    strangers = [str(d) for d in unknown.dependencies or () if d not in known]
    if strangers:
        yield Finding(
            "structure-unknown-variable", _where(unknown.line),
            f"the dependencies of {_name(unknown, known)} name {what} {listed(strangers)}, which "
            f"no variable has{last}",
        )  # fmt: skip


def _kinds(unknown: Unknown) -> Iterator[Finding]:
    if unknown.kinds is None:
        return
    if len(unknown.kinds) != len(unknown.dependencies or ()):
        yield Finding(
            "structure-dependencies", _where(unknown.line),
            f"ModelStructure/{unknown.kind}: {len(unknown.kinds)} dependenciesKind for "
            f"{len(unknown.dependencies or ())} dependencies; one belongs to each",
        )  # fmt: skip


def _name(unknown: Unknown, known: dict[int | None, Variable]) -> str:
    variable = known.get(unknown.key)
    return variable.name if variable else f"ModelStructure/{unknown.kind} {unknown.key}"


def _outputs(description: Description, known: dict[int | None, Variable]) -> Iterator[Finding]:
    expected = [v for v in description.variables if v.causality == "output"]
    yield from _compare(description, known, expected, OUTPUTS, "output")


def _initial(description: Description, known: dict[int | None, Variable]) -> Iterator[Finding]:
    open_ = ("approx", "calculated")
    expected = [
        v
        for v in description.variables
        if v.causality == "calculatedParameter"
        or (v.causality == "output" and v.initial in open_ and not v.clocked)
    ]
    for unknown in description.unknowns:
        derivative = known.get(unknown.key) if unknown.kind in DERIVATIVES else None
        state = known.get(derivative.derivative) if derivative else None
        expected += [v for v in (derivative, state) if v and v.initial in open_]
    yield from _compare(description, known, expected, INITIAL_UNKNOWNS, "initial-unknown")


def _compare(
    description: Description,
    known: dict[int | None, Variable],
    expected: list[Variable],
    kinds: tuple[str, str],
    what: str,
) -> Iterator[Finding]:
    """Compare a list of ModelStructure with the variables that belong there, aliases as one."""
    entries = [u for u in description.unknowns if u.kind in kinds and u.key in known]
    covered = {(known[u.key].type, known[u.key].reference) for u in entries}
    missing = {v.name: v for v in expected if (v.type, v.reference) not in covered}
    title = kinds[description.major - 2]
    if missing:
        line = next(iter(missing.values())).line
        yield Finding(
            f"structure-{what}-missing", _where(line),
            f"ModelStructure/{title} lacks {listed(missing)}; every "
            f"{'output' if what == 'output' else 'variable computed at the start'} belongs there",
        )  # fmt: skip
    names = {v.name for v in expected}
    right = {(v.type, v.reference) for v in expected}
    for unknown in entries:
        v = known[unknown.key]
        if v.name not in names and (v.type, v.reference) not in right:
            yield Finding(
                f"structure-{what}-extra", _where(unknown.line),
                f"ModelStructure/{title} lists {v.name}, whose causality is {v.causality} and "
                f"initial is {v.initial or 'none'}; it does not belong there",
            )  # fmt: skip
    seen: set[int | None] = set()
    for unknown in entries:
        if unknown.key in seen:
            yield Finding(
                "structure-duplicate", _where(unknown.line),
                f"ModelStructure/{title} lists {known[unknown.key].name} more than once",
            )  # fmt: skip
        seen.add(unknown.key)
