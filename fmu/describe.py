"""XML and HTML of an FMU from its variable table, for FMI 2.0 and FMI 3.0."""

import html
import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence

from variables import TIME_REFERENCE, Table, Variable

TOOL = "suspension-cosim fmu/build.py"
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


def _shared_head(root: ET.Element, table: Table) -> None:
    """Unit definitions and log categories, which both versions write alike."""
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
    _shared_head(root, table)
    _experiment(root, table)
    variables = add(root, "ModelVariables")
    for variable in table.variables:
        scalar = add(variables, "ScalarVariable", **_common(variable))
        _set_start(add(scalar, FMI2_TYPES[variable.type], **_real(variable)), variable)
    structure = add(root, "ModelStructure")
    outputs, unknowns = add(structure, "Outputs"), add(structure, "InitialUnknowns")
    for index, variable in enumerate(table.variables, start=1):
        if variable.causality == "output":
            # inputs act over the step that follows: nothing passes straight through
            add(outputs, "Unknown", index=index).set("dependencies", "")
            add(unknowns, "Unknown", index=index)  # at the start: on everything that can be set
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
    _shared_head(root, table)
    _experiment(root, table)
    variables = add(root, "ModelVariables")
    add(
        variables, "Float64", name="time", valueReference=TIME_REFERENCE,
        description="Simulation time", causality="independent", variability="continuous", unit="s",
    )  # fmt: skip
    structure = add(root, "ModelStructure")
    for variable in table.variables:
        element = add(variables, variable.type, **_common(variable), **_real(variable))
        if variable.type == "String" and variable.causality != "output":
            ET.SubElement(element, "Start", {"value": str(variable.start)})
        elif variable.type != "String":
            _set_start(element, variable)
    outputs = [v.reference for v in table.variables if v.causality == "output"]
    for reference in outputs:
        add(structure, "Output", valueReference=reference).set("dependencies", "")
    for reference in outputs:
        add(structure, "InitialUnknown", valueReference=reference)
    return document(root)


def build_description(table: Table, sources: Sequence[str], options: str) -> bytes:
    """``sources/buildDescription.xml`` of FMI 3.0."""
    root = ET.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = add(root, "BuildConfiguration", modelIdentifier=table.model["identifier"])
    files = add(configuration, "SourceFileSet", language="C11", compilerOptions=options)
    for name in sources:
        add(files, "SourceFile", name=name)
    add(configuration, "Library", name="m", external=True, description="C mathematics library")
    return document(root)


def terminals(table: Table) -> bytes:
    """``terminalsAndIcons/terminalsAndIcons.xml`` of FMI 3.0: variables that belong together."""
    root = ET.Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    group = add(root, "Terminals")
    for name, terminal in table.terminals.items():
        element = add(
            group, "Terminal", name=name, matchingRule="plug",
            terminalKind=terminal.get("kind"), description=terminal.get("description"),
        )  # fmt: skip
        for member in terminal["members"]:
            add(
                element, "TerminalMemberVariable",
                variableName=member, memberName=member, variableKind="signal",
            )  # fmt: skip
    return document(root)


def _cells(variable: Variable) -> list[str]:
    limits = ["" if math.isinf(v) else f"{v:g}" for v in (variable.minimum, variable.maximum)]
    start = "" if variable.causality == "output" else text(variable.start)
    kind = variable.variability if variable.causality == "parameter" else variable.causality
    return [variable.name, kind, variable.unit, start, *limits, variable.description]


def documentation(table: Table, version: str) -> bytes:
    """``documentation/index.html``: what the model is and every variable."""
    model = table.model
    heads = ("name", "kind", "unit", "start", "min", "max", "description")
    rows = "\n".join(
        "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in _cells(v)) + "</tr>"
        for v in table.variables
    )
    name = html.escape(model["name"])
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{name}</title>
<style>body{{font:15px sans-serif;margin:2em}}
td,th{{text-align:left;padding:2px 12px 2px 0}}</style>
</head><body>
<h1>{name} {html.escape(version)}</h1>
<p>{html.escape(model["description"])}</p>
<p>Recommended communication step {model["step_size"]} s; inputs are held over a step.
Values are in the units of the table. A parameter beyond its range, a value that is not finite and
a call at the wrong time are refused with a message; a refused call changes nothing. An input beyond
its range acts at its limit, with one warning.</p>
<table><tr>{"".join(f"<th>{h}</th>" for h in heads)}</tr>
{rows}
</table></body></html>
""".encode()
