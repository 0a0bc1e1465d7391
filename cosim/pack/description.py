"""The template's XML files made those of one network: its name, its token, its variables."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final
from xml.etree import ElementTree as ET

TERMINALS: Final = "terminalsAndIcons/terminalsAndIcons.xml"


@dataclass(frozen=True)
class Identity:
    """What an FMU is known by: model name, description in a sentence, token, and the variables of
    the template that its network does not have.
    """

    name: str
    description: str
    token: str
    absent: frozenset[str]


def model_description(xml: bytes, identity: Identity) -> bytes:
    """Return `modelDescription.xml` of FMI 2.0 or 3.0 with another identity, and without the absent
    variables.
    """
    root = ET.fromstring(xml)
    fmi2 = str(root.get("fmiVersion")).startswith("2.")
    root.set("modelName", identity.name)
    root.set("description", identity.description)
    root.set("guid" if fmi2 else "instantiationToken", identity.token)
    root.set("generationTool", f"suspension-cosim {root.get('version')}, cosim pack")
    if fmi2:
        _without_by_index(root, identity.absent)
    else:
        _without_by_reference(root, identity.absent)
    return _written(root)


def terminals(xml: bytes, absent: Collection[str]) -> bytes:
    """Return `terminalsAndIcons.xml` without the absent variables, and without empty terminals."""
    root = ET.fromstring(xml)
    for group in root.iter("Terminals"):
        for terminal in list(group):
            for member in list(terminal):
                if member.get("variableName") in absent:
                    terminal.remove(member)
            if not len(terminal):
                group.remove(terminal)
    return _written(root)


def _part(root: ET.Element, tag: str) -> ET.Element:
    found = root.find(tag)
    assert found is not None, tag  # the template is our own
    return found


def _without_by_index(root: ET.Element, absent: Collection[str]) -> None:
    """FMI 2: the model structure names variables by their place, counted from 1."""
    variables, place, removed = _part(root, "ModelVariables"), {}, set()
    for old, variable in enumerate(list(variables), start=1):
        if variable.get("name") in absent:
            variables.remove(variable)
            removed.add(old)
        else:
            place[old] = old - len(removed)
    for kind in _part(root, "ModelStructure"):
        for unknown in list(kind):
            index = int(unknown.get("index", "0"))
            if index in removed:
                kind.remove(unknown)
                continue
            unknown.set("index", str(place[index]))
            on = [int(number) for number in unknown.get("dependencies", "").split()]
            unknown.set("dependencies", " ".join(str(place[i]) for i in on if i in place))


def _without_by_reference(root: ET.Element, absent: Collection[str]) -> None:
    """FMI 3: the model structure names variables by their value reference."""
    variables, removed = _part(root, "ModelVariables"), set()
    for variable in list(variables):
        if variable.get("name") in absent:
            variables.remove(variable)
            removed.add(variable.get("valueReference"))
    structure = _part(root, "ModelStructure")
    for unknown in list(structure):
        if unknown.get("valueReference") in removed:
            structure.remove(unknown)
            continue
        on = [number for number in unknown.get("dependencies", "").split() if number not in removed]
        unknown.set("dependencies", " ".join(on))


def _written(root: ET.Element) -> bytes:
    ET.indent(root)
    body: bytes = ET.tostring(root, encoding="utf-8")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + body + b"\n"
