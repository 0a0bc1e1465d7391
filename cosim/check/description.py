"""The model description as the checks read it: tolerant, with the line of every part.

Defaults and resolved types follow FMI 2.0.5 (section 2.2) and FMI 3.0 (section 2.4). What cannot be
read is None here; the schema says why.
"""

from __future__ import annotations

from typing import Any, Final

from cosim.check.parts import (
    FLOATS,
    DisplayUnit,
    Unit,
    Unknown,
    Variable,
    number,
    truth,
    whole,
)

FMI2_TYPES: Final = ("Real", "Integer", "Boolean", "String", "Enumeration")
FMI3_TYPES: Final = (
    "Float32", "Float64", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64",
    "Boolean", "String", "Binary", "Enumeration", "Clock",
)  # fmt: skip
PARAMETERS: Final = ("parameter", "calculatedParameter", "structuralParameter")
# `initial` where it is left out, by variability and causality
INITIAL: Final = {
    "constant": {"output": "exact", "local": "exact"},
    "fixed": {
        "parameter": "exact", "structuralParameter": "exact",
        "calculatedParameter": "calculated", "local": "calculated",
    },
    "tunable": {
        "parameter": "exact", "structuralParameter": "exact",
        "calculatedParameter": "calculated", "local": "calculated",
    },
    "discrete": {"output": "calculated", "local": "calculated"},
    "continuous": {"output": "calculated", "local": "calculated"},
}  # fmt: skip


class Description:
    """The parts of a model description that the checks judge."""

    def __init__(self, root: Any) -> None:
        self.root = root
        self.version = str(root.get("fmiVersion") or "")
        self.major = 2 if self.version.startswith("2.") else 3
        self.name = str(root.get("modelName") or "")
        self.token = str(root.get("guid" if self.major == 2 else "instantiationToken") or "")
        self.types = _types(root, self.major)
        self.units = [_unit(element) for element in root.findall("UnitDefinitions/Unit")]
        self.variables = _variables(root, self.major, self.types)
        self.unknowns = _unknowns(root, self.major)
        self.experiment = root.find("DefaultExperiment")
        self.simulation = root.find("CoSimulation")
        self.categories = [
            str(e.get("name")) for e in root.findall("LogCategories/Category") if e.get("name")
        ]
        self.by_name = {v.name: v for v in self.variables}
        for v in self.variables:
            self.by_name.update({alias: v for alias, _, _ in v.aliases})

    @property
    def identifier(self) -> str:
        """The model identifier for co-simulation."""
        return "" if self.simulation is None else str(self.simulation.get("modelIdentifier") or "")

    def flag(self, name: str) -> bool:
        """Return a capability of the co-simulation interface, by FMI 3's spelling."""
        if self.simulation is None:
            return False
        spellings = {
            "canGetAndSetFMUState": "canGetAndSetFMUstate",
            "canSerializeFMUState": "canSerializeFMUstate",
            "providesDirectionalDerivatives": "providesDirectionalDerivative",
        }
        spelling = spellings.get(name, name) if self.major == 2 else name
        return truth(self.simulation.get(spelling))

    def flag_name(self, name: str) -> str:
        """Return how this FMI version spells a capability of `flag`."""
        if self.major == 3:
            return name
        return name.replace("FMUState", "FMUstate").replace("Derivatives", "Derivative")

    def default(self, attribute: str) -> float | None:
        """Return an attribute of DefaultExperiment [s]."""
        return None if self.experiment is None else number(self.experiment.get(attribute))


def _types(root: Any, major: int) -> dict[str, Any]:
    """The elements with the attributes of each type definition, by name."""
    if major == 3:
        return {str(e.get("name")): e for e in root.findall("TypeDefinitions/*")}
    return {
        str(e.get("name")): e[0] for e in root.findall("TypeDefinitions/SimpleType") if len(e) > 0
    }


def _unit(element: Any) -> Unit:
    base = element.find("BaseUnit")
    exponents = None
    if base is not None:
        dimensions = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
        exponents = {name: whole(base.get(name, "0")) or 0 for name in dimensions}
    attributes = {} if base is None else base.attrib
    display = tuple(
        DisplayUnit(
            str(e.get("name")), e.sourceline, _or(e.get("factor"), 1.0), _or(e.get("offset"), 0.0),
            truth(e.get("inverse")),
        )
        for e in element.findall("DisplayUnit")
    )  # fmt: skip
    return Unit(
        str(element.get("name")), element.sourceline, exponents,
        _or(attributes.get("factor"), 1.0), _or(attributes.get("offset"), 0.0), display,
    )  # fmt: skip


def _or(text: str | None, default: float) -> float:
    value = number(text)
    return default if value is None else value


def _variables(root: Any, major: int, types: dict[str, Any]) -> list[Variable]:
    parent = root.find("ModelVariables")
    elements = [] if parent is None else [e for e in parent if isinstance(e.tag, str)]
    starts = {
        whole(e.get("valueReference")): whole(e.get("start"))
        for e in elements
        if e.get("causality") == "structuralParameter"
    }
    made = []
    for index, element in enumerate(elements, start=1):
        variable = _variable(element, index, major, types, starts)
        if variable is not None:
            made.append(variable)
    return made


def _variable(
    element: Any, index: int, major: int, types: dict[str, Any], structural: dict[Any, int | None]
) -> Variable | None:
    own = element
    if major == 2:
        typed = [child for child in element if child.tag in FMI2_TYPES]
        if not typed:
            return None
        own = typed[0]
    kind = str(own.tag)
    if kind not in (FMI2_TYPES if major == 2 else FMI3_TYPES) or element.get("name") is None:
        return None
    declared = types.get(str(own.get("declaredType")))

    def attribute(name: str) -> Any:
        value = own.get(name)
        return value if value is not None or declared is None else declared.get(name)

    causality = str(element.get("causality") or "local")
    variability = element.get("variability") or _variability(major, kind, causality)
    initial = element.get("initial") or INITIAL.get(variability, {}).get(causality)
    description = element.get("description")
    if description is None and declared is not None:
        description = (declared if major == 3 else declared.getparent()).get("description")
    low, high = number(attribute("min")), number(attribute("max"))
    if kind == "Enumeration" and declared is not None:
        items = [whole(item.get("value")) for item in declared.findall("Item")]
        values = [value for value in items if value is not None]
        low = min(values, default=None) if low is None else low
        high = max(values, default=None) if high is None else high
    return Variable(
        name=str(element.get("name")),
        reference=whole(element.get("valueReference")),
        index=index,
        line=element.sourceline,
        type=kind,
        causality=causality,
        variability=str(variability),
        initial=initial,
        description=str(description or ""),
        starts=_starts(element, own, major, kind),
        minimum=low,
        maximum=high,
        nominal=number(attribute("nominal")),
        unit=attribute("unit"),
        display_unit=attribute("displayUnit"),
        declared_type=own.get("declaredType"),
        derivative=whole(own.get("derivative")),
        size=_size(element, structural),
        clocked=bool(element.get("clocks")),
        aliases=tuple(
            (str(a.get("name")), a.get("displayUnit"), a.sourceline)
            for a in element.findall("Alias")
        ),
    )


def _variability(major: int, kind: str, causality: str) -> str:
    if major == 2:
        return "continuous"  # the schema's default, whatever the type
    if causality in PARAMETERS:
        return "fixed"
    return "continuous" if kind in FLOATS else "discrete"


def _starts(element: Any, own: Any, major: int, kind: str) -> tuple[str, ...] | None:
    if major == 3 and kind in ("String", "Binary"):
        texts = tuple(str(e.get("value") or "") for e in element.findall("Start"))
        return texts or None
    text = own.get("start")
    if text is None:
        return None
    return (str(text),) if major == 2 else tuple(str(text).split())


def _size(element: Any, structural: dict[Any, int | None]) -> int | None:
    size = 1
    for dimension in element.findall("Dimension"):
        count = whole(dimension.get("start"))
        if count is None:
            count = structural.get(whole(dimension.get("valueReference")))
        if count is None:
            return None
        size *= count
    return size


def _unknowns(root: Any, major: int) -> list[Unknown]:
    structure = root.find("ModelStructure")
    if structure is None:
        return []
    if major == 2:
        elements = [(e.getparent().tag, e) for e in structure.findall("*/Unknown")]
    else:
        elements = [(e.tag, e) for e in structure if isinstance(e.tag, str)]
    key = "index" if major == 2 else "valueReference"
    made = []
    for kind, e in elements:
        dependencies, kinds = e.get("dependencies"), e.get("dependenciesKind")
        made.append(
            Unknown(
                str(kind), whole(e.get(key)), e.sourceline,
                None if dependencies is None else tuple(whole(d) for d in dependencies.split()),
                None if kinds is None else tuple(kinds.split()),
            )
        )  # fmt: skip
    return made
