"""``modelDescription.xml`` of an FMU from its variable table, for FMI 2.0 and FMI 3.0."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence

from table import TIME_REFERENCE, Table, TypeDefinition, Variable

TOOL = "suspension-cosim fmu/build.py"
NO_FEEDTHROUGH = ""  # inputs act over the step that follows: no output depends on one directly
FMI2_TYPES = {"Float64": "Real", "Boolean": "Boolean", "String": "String"}


def text(value: object) -> str:
    """An attribute value: numbers in full precision, Booleans as XML has them."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


def add(parent: ET.Element, tag: str, **attributes: object) -> ET.Element:
    """A child element; attributes that are None or empty are left out."""
    given = {k: text(v) for k, v in attributes.items() if v is not None and v != ""}
    return ET.SubElement(parent, tag, given)


def document(root: ET.Element) -> bytes:
    """The bytes of an XML file, indented, with declaration."""
    ET.indent(root)
    body: bytes = ET.tostring(root, encoding="utf-8")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + body + b"\n"


def _root(table: Table, version: str, fmi: str, token: dict[str, str]) -> ET.Element:
    model = table.model
    return ET.Element(
        "fmiModelDescription",
        {
            "fmiVersion": fmi,
            "modelName": model["name"],
            **token,
            "description": model["description"],
            "author": model.get("author", ""),
            "version": version,
            "license": model.get("license", ""),
            "generationTool": TOOL,
            "variableNamingConvention": "structured",
        },
    )


def _units(root: ET.Element, table: Table) -> None:
    units = add(root, "UnitDefinitions")
    for unit in table.units:
        element = add(units, "Unit", name=unit.name)
        exponents = {name: power for name, power in unit.base.items() if power}
        if unit.factor != 1.0:
            exponents["factor"] = unit.factor  # type: ignore[assignment]
        add(element, "BaseUnit", **exponents)
        for display in unit.display:
            offset = display.offset if display.offset else None
            add(element, "DisplayUnit", name=display.name, factor=display.factor, offset=offset)


def _type_attributes(definition: TypeDefinition) -> dict[str, object]:
    return {
        "quantity": definition.name, "unit": definition.unit, "nominal": definition.nominal,
    }  # fmt: skip


def _categories(root: ET.Element, table: Table) -> None:
    categories = add(root, "LogCategories")
    for name, description in table.model["log_categories"]:
        add(categories, "Category", name=name, description=description)


def _experiment(root: ET.Element, table: Table) -> None:
    stop, step = float(table.model["stop_time"]), float(table.model["step_size"])
    add(root, "DefaultExperiment", startTime=0.0, stopTime=stop, stepSize=step)


def _finite(value: float) -> float | None:
    return None if math.isinf(value) else value


def _real(variable: Variable) -> dict[str, object]:
    """Attributes that only floating-point variables have."""
    if variable.type != "Float64":
        return {}
    return {
        "declaredType": variable.declared_type,
        "quantity": variable.quantity,
        "unit": variable.unit,
        "displayUnit": variable.display,
        "min": _finite(variable.minimum),
        "max": _finite(variable.maximum),
        "nominal": None if variable.nominal is None else float(variable.nominal),
    }


def _common(variable: Variable) -> dict[str, object]:
    """Attributes every variable has in both versions."""
    return {
        "name": variable.name,
        "valueReference": variable.reference,
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
        "initial": {"output": "calculated", "parameter": "exact"}.get(variable.causality),
    }


def _time(table: Table) -> dict[str, object]:
    """The independent variable."""
    declared = next((d.name for d in table.types if d.unit == "s"), None)
    return {
        "name": "time", "valueReference": TIME_REFERENCE, "description": "Simulation time",
        "causality": "independent", "variability": "continuous", "declaredType": declared,
        "unit": "s",
    }  # fmt: skip


def _depend(unknown: ET.Element, table: Table, output: Variable, number: dict[str, int]) -> None:
    """What an output depends on at the start; without a word on it, importers assume everything."""
    if output.name in table.initial:
        knowns = sorted(number[name] for name in table.initial[output.name])
        unknown.set("dependencies", " ".join(map(str, knowns)))


def _set_start(element: ET.Element, variable: Variable) -> None:
    """Also the empty string, which `add` would leave out."""
    if variable.causality != "output":
        element.set("start", text(variable.start))


def fmi2(table: Table, version: str, token: str, sources: Sequence[str]) -> bytes:
    """``modelDescription.xml`` of FMI 2.0, co-simulation."""
    root = _root(table, version, "2.0", {"guid": token})
    simulation = add(
        root,
        "CoSimulation",
        modelIdentifier=table.model["identifier"],
        canHandleVariableCommunicationStepSize=True,
        canNotUseMemoryManagementFunctions=True,
        canGetAndSetFMUstate=True,
        canSerializeFMUstate=True,
    )
    files = add(simulation, "SourceFiles")
    for name in sources:
        add(files, "File", name=name)
    _units(root, table)
    types = add(root, "TypeDefinitions") if table.types else root
    for definition in table.types:
        add(add(types, "SimpleType", name=definition.name), "Real", **_type_attributes(definition))
    _categories(root, table)
    _experiment(root, table)
    variables = add(root, "ModelVariables")
    for variable in table.variables:
        scalar = add(variables, "ScalarVariable", **_common(variable))
        _set_start(add(scalar, FMI2_TYPES[variable.type], **_real(variable)), variable)
    time = _time(table)
    own = {"declaredType": time.pop("declaredType"), "unit": time.pop("unit")}
    add(add(variables, "ScalarVariable", **time), "Real", **own)
    structure = add(root, "ModelStructure")
    outputs, unknowns = add(structure, "Outputs"), add(structure, "InitialUnknowns")
    index = {variable.name: i for i, variable in enumerate(table.variables, start=1)}
    for variable in table.of_causality("output"):
        add(outputs, "Unknown", index=index[variable.name]).set("dependencies", NO_FEEDTHROUGH)
        unknown = add(unknowns, "Unknown", index=index[variable.name])
        _depend(unknown, table, variable, index)
    return document(root)


def fmi3(table: Table, version: str, token: str) -> bytes:
    """``modelDescription.xml`` of FMI 3.0, co-simulation."""
    root = _root(table, version, "3.0", {"instantiationToken": token})
    add(
        root,
        "CoSimulation",
        modelIdentifier=table.model["identifier"],
        canGetAndSetFMUState=True,
        canSerializeFMUState=True,
        canHandleVariableCommunicationStepSize=True,
    )
    _units(root, table)
    types = add(root, "TypeDefinitions") if table.types else root
    for definition in table.types:
        add(types, "Float64Type", name=definition.name, **_type_attributes(definition))
    _categories(root, table)
    _experiment(root, table)
    variables = add(root, "ModelVariables")
    add(variables, "Float64", **_time(table))
    structure = add(root, "ModelStructure")
    for variable in table.variables:
        element = add(variables, variable.type, **_common(variable), **_real(variable))
        if variable.type == "String" and variable.causality != "output":
            ET.SubElement(element, "Start", {"value": str(variable.start)})
        elif variable.type != "String":
            _set_start(element, variable)
    reference = {variable.name: variable.reference for variable in table.variables}
    outputs = table.of_causality("output")
    for variable in outputs:
        output = add(structure, "Output", valueReference=variable.reference)
        output.set("dependencies", NO_FEEDTHROUGH)
    for variable in outputs:
        unknown = add(structure, "InitialUnknown", valueReference=variable.reference)
        _depend(unknown, table, variable, reference)
    return document(root)
