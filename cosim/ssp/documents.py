"""The two XML files of an SSP: SystemStructure.ssd and its parameter values (SSP 1.0)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from lxml import etree

from cosim.ssp.structure import VEHICLE, Component, Connection, Connector, Structure

VERSION: Final = "1.0"
SYSTEM_NAME: Final = "test_bench"  # some masters take identifiers only
PARAMETERS: Final = "resources/parameters.ssv"
_NAMESPACES: Final = {
    prefix: f"http://ssp-standard.org/SSP1/SystemStructure{name}"
    for prefix, name in (
        ("ssc", "Common"),
        ("ssd", "Description"),
        ("ssv", "ParameterValues"),
    )
}
Units = Mapping[str, Mapping[str, float]]


def system_structure(structure: Structure, stop_s: float) -> bytes:
    """Return SystemStructure.ssd; the default experiment goes from 0 to `stop_s` [s]."""
    root = _root("ssd", "SystemStructureDescription", structure.name, ("ssd", "ssc"))
    root.set("description", structure.description)
    system = _add(root, "ssd:System", name=SYSTEM_NAME)
    if structure.connectors:
        _connectors(system, structure.connectors)
    elements = _add(system, "ssd:Elements")
    for component in structure.components:
        _component(elements, component)
    connections = _add(system, "ssd:Connections")
    for connection in structure.connections:
        _connection(connections, connection)
    used = {c.unit for part in structure.components for c in part.connectors}
    used |= {c.unit for c in structure.connectors}
    _units(_add(root, "ssd:Units"), structure.units, used)
    _add(root, "ssd:DefaultExperiment", startTime="0", stopTime=repr(stop_s))
    return _written(root)


def parameter_values(
    name: str, values: Mapping[str, bool | float | str], unit_of: Mapping[str, str], units: Units
) -> bytes:
    """Return one component's parameter values as SSV, in the units of `unit_of` if any."""
    root = _root("ssv", "ParameterSet", name, ("ssv", "ssc"))
    parameters = _add(root, "ssv:Parameters")
    for parameter, value in values.items():
        entry = _add(parameters, "ssv:Parameter", name=parameter)
        kind, text = _typed(value)
        element = _add(entry, f"ssv:{kind}", value=text)
        if parameter in unit_of and kind == "Real":
            element.set("unit", unit_of[parameter])
    used = {unit_of[parameter] for parameter in values if parameter in unit_of}
    if used:
        _units(_add(root, "ssv:Units"), units, used)
    return _written(root)


def _typed(value: bool | float | str) -> tuple[str, str]:
    if isinstance(value, bool):
        return "Boolean", "true" if value else "false"
    if isinstance(value, str):
        return "String", value
    return ("Integer", str(value)) if isinstance(value, int) else ("Real", repr(float(value)))


def _component(elements: Any, component: Component) -> None:
    element = _add(
        elements,
        "ssd:Component",
        name=component.name,
        description=component.description,
        type="application/x-fmu-sharedlibrary",
        source=f"resources/{component.name}.fmu",
        implementation="CoSimulation",
    )
    _connectors(element, component.connectors)
    if component.name == VEHICLE:  # at the component, where every master looks for them
        bindings = _add(element, "ssd:ParameterBindings")
        _add(bindings, "ssd:ParameterBinding", source=PARAMETERS)


def _connectors(parent: Any, connectors: Iterable[Connector]) -> None:
    group = _add(parent, "ssd:Connectors")
    for connector in connectors:
        element = _add(group, "ssd:Connector", name=connector.name, kind=connector.kind)
        kind = _add(element, f"ssc:{connector.type}")
        if connector.unit is not None and connector.type == "Real":
            kind.set("unit", connector.unit)


def _connection(connections: Any, connection: Connection) -> None:
    ends: dict[str, str] = {}
    for side, (element, connector) in (("start", connection.source), ("end", connection.target)):
        ends |= {f"{side}Element": element} if element is not None else {}
        ends[f"{side}Connector"] = connector
    element = _add(connections, "ssd:Connection", **ends)
    if connection.converts:  # our own factor and offset stand for the units' too
        element.set("suppressUnitConversion", "true")
        _add(
            element,
            "ssc:LinearTransformation",
            factor=repr(connection.factor),
            offset=repr(connection.offset),
        )


def _units(group: Any, units: Units, used: Iterable[str | None]) -> None:
    for name in sorted(name for name in used if name is not None):
        unit = _add(group, "ssc:Unit", name=name)
        base = {key: f"{value:.17g}" for key, value in units[name].items()}
        _add(unit, "ssc:BaseUnit", **base)


def _root(prefix: str, tag: str, name: str, prefixes: Iterable[str]) -> Any:
    spaces = {p: _NAMESPACES[p] for p in prefixes}
    return etree.Element(
        f"{{{_NAMESPACES[prefix]}}}{tag}", nsmap=spaces, version=VERSION, name=name
    )


def _add(parent: Any, tag: str, **attributes: str) -> Any:
    prefix, _, local = tag.partition(":")
    return etree.SubElement(parent, f"{{{_NAMESPACES[prefix]}}}{local}", **attributes)


def _written(root: Any) -> bytes:
    text: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    return text
