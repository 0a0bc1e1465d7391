"""FMUs with one defect each, made from a sound one: edited XML, other files, other binaries."""

from __future__ import annotations

import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

Edit = Callable[[ET.Element], None]
MODEL = "modelDescription.xml"


def mutate(
    source: Path,
    target: Path,
    edits: Mapping[str, Edit] | None = None,
    files: Mapping[str, bytes | None] | None = None,
    renamed: Mapping[str, str] | None = None,
) -> Path:
    """Write the FMU `source` with edited XML entries, other contents (None: left out) and names."""
    files, renamed, edits = dict(files or {}), renamed or {}, edits or {}
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content: bytes | None = files.pop(name, old.read(name))
            if content is None:
                continue
            if name in edits:
                content = edited(content, edits[name])
            for start, other in renamed.items():
                if name.startswith(start):
                    name = other + name[len(start) :]
            new.writestr(name, content)
        for name, content in files.items():
            if content is not None:
                new.writestr(name, content)
    return target


def edited(content: bytes, edit: Edit) -> bytes:
    """Return XML with an edit; lines stay where they are."""
    root = ET.fromstring(content)
    edit(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root)


def entry(root: ET.Element, path: str) -> ET.Element:
    """Return the first element at a path."""
    element = root.find(path)
    assert element is not None, path
    return element


def variable(root: ET.Element, name: str) -> ET.Element:
    """Return the element of a variable, which has its name and reference."""
    return next(e for e in entry(root, "ModelVariables") if e.get("name") == name)


def typed(root: ET.Element, name: str) -> ET.Element:
    """Return the element with a variable's start, unit and range: in FMI 2.0 one level below."""
    element = variable(root, name)
    return element[0] if element.tag == "ScalarVariable" else element


def put(name: str, /, **attributes: str | None) -> Edit:
    """Return an edit that sets attributes of a variable's type part, None to take one away."""

    def edit(root: ET.Element) -> None:
        change(typed(root, name), **attributes)

    return edit


def put_outer(name: str, /, **attributes: str | None) -> Edit:
    """Return an edit that sets attributes of a variable itself."""
    return lambda root: change(variable(root, name), **attributes)


def put_at(path: str, /, **attributes: str | None) -> Edit:
    """Return an edit that sets attributes of the first element at a path."""
    return lambda root: change(entry(root, path), **attributes)


def change(element: ET.Element, **attributes: str | None) -> None:
    """Set or take away attributes."""
    for key, value in attributes.items():
        if value is None:
            element.attrib.pop(key, None)
        else:
            element.set(key, value)


def unit(root: ET.Element, name: str) -> ET.Element:
    """Return the definition of a unit."""
    return next(e for e in entry(root, "UnitDefinitions") if e.get("name") == name)


def add_unit(name: str, **base: str) -> Edit:
    """Return an edit that defines a unit by the attributes of its BaseUnit."""

    def edit(root: ET.Element) -> None:
        element = ET.SubElement(entry(root, "UnitDefinitions"), "Unit", name=name)
        ET.SubElement(element, "BaseUnit", base)

    return edit


def version_of(root: ET.Element) -> int:
    """Return 2 or 3."""
    return int(str(root.get("fmiVersion"))[0])
