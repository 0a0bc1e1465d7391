"""An FMU with variables of every type (tests/types_fmu), for the checker's own calls."""

from __future__ import annotations

import re
import shutil
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path
from typing import Final

from fmu_face import build, package, toolchain

SOURCE: Final = Path(__file__).parent / "types_fmu" / "types.c"
TOKEN: Final = "{0f4d4f5c-2d33-4c1e-9d6c-5d7a31b7c2aa}"
TYPES: Final = {
    2: ("Real", "Integer", "Boolean", "String", "Enumeration"),
    3: ("Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64",
        "UInt64", "Boolean", "String", "Enumeration"),
}  # fmt: skip
PLACES: Final = ("parameter", "input", "output")


def types_fmu(path: Path, version: int) -> Path:
    """Write the FMU."""
    folder = path.parent
    root = _description(version)
    header = (toolchain.header_directory() / f"fmi{version}Functions.h").read_text()
    names = re.findall(rf"#define (fmi{version}\w+) +fmi{version}FullName", header)
    weak = "".join(f"__attribute__((weak)) int {n}(void) {{ return 3; }}\n" for n in names)
    (folder / "refusals.c").write_text(weak)
    shutil.copy(SOURCE, folder)
    headers = f"-I{toolchain.header_directory()}"
    flags = [f"-DFMI{version}", headers, "-fPIC", "-shared", "-w", "-fvisibility=default"]
    command = [*build.compiler(None), *flags, "types.c", "refusals.c", "-o", "types.so"]
    build.run_compiler(command, folder)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", ET.tostring(root))
        target = package.binary_path("types", version, build.target_platform())
        archive.write(folder / "types.so", target)
    return path


def _description(version: int) -> ET.Element:
    token = {2: "guid", 3: "instantiationToken"}[version]
    head = {"fmiVersion": f"{version}.0", "modelName": "Types", token: TOKEN}
    root = ET.Element("fmiModelDescription", head)
    flag = {"canHandleVariableCommunicationStepSize": "true"}
    ET.SubElement(root, "CoSimulation", modelIdentifier="types", **flag)
    ET.SubElement(ET.SubElement(root, "UnitDefinitions"), "Unit", name="1")
    _gears(ET.SubElement(root, "TypeDefinitions"), version)
    ET.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", stepSize="0.1")
    variables = ET.SubElement(root, "ModelVariables")
    structure = ET.SubElement(root, "ModelStructure")
    lists = [structure, structure]
    if version == 2:
        lists = [ET.SubElement(structure, n) for n in ("Outputs", "InitialUnknowns")]
    else:
        time = {"causality": "independent", "variability": "continuous", "unit": "1"}
        ET.SubElement(variables, "Float64", name="time", valueReference="9", **time)
        array = {"causality": "parameter", "variability": "fixed", "start": "1 1 1", "unit": "1"}
        element = ET.SubElement(variables, "Float64", name="gains", valueReference="3", **array)
        element.set("description", "Three gains")
        ET.SubElement(element, "Dimension", start="3")
    known = [_add(variables, kind, place, version)
             for kind in TYPES[version] for place in PLACES]  # fmt: skip
    for i, tag in enumerate(("Output", "InitialUnknown")):
        for name, reference, index in known:
            if name.endswith("output"):
                key = {"index": str(index)} if version == 2 else {"valueReference": str(reference)}
                ET.SubElement(lists[i], "Unknown" if version == 2 else tag, key)
    return root


def _gears(parent: ET.Element, version: int) -> None:
    if version == 2:
        parent = ET.SubElement(ET.SubElement(parent, "SimpleType", name="Gear"), "Enumeration")
    else:
        parent = ET.SubElement(parent, "EnumerationType", name="Gear")
    for value, name in enumerate(("first", "second", "third"), start=1):
        ET.SubElement(parent, "Item", name=name, value=str(value))


def _add(parent: ET.Element, kind: str, place: str, version: int) -> tuple[str, int, int]:
    """Add a variable; return its name, reference and place in the list from 1."""
    # an enumeration is got and set as the type of whole numbers behind it, at places of its own
    behind = {2: "Integer", 3: "Int64"}[version]
    number = TYPES[version].index(behind if kind == "Enumeration" else kind)
    first = 6 if kind == "Enumeration" else 0
    reference = 100 * (number + 1) + first + PLACES.index(place)
    smooth = kind in ("Real", "Float64", "Float32")
    outer = {
        "name": f"{kind}.{place}", "valueReference": str(reference), "causality": place,
        "description": f"The {place} of type {kind}",
        "variability": "fixed" if place == "parameter" else "continuous" if smooth else "discrete",
    }  # fmt: skip
    own: dict[str, str] = {"unit": "1"} if smooth else {}
    own |= {"declaredType": "Gear"} if kind == "Enumeration" else {}
    start = {"Boolean": "false", "String": "a"}.get(kind, "1" if smooth else "2")
    if version == 2:
        element = ET.SubElement(parent, "ScalarVariable", outer)
        inner = ET.SubElement(element, kind, own)
        if place != "output":
            inner.set("start", start)
    else:
        element = ET.SubElement(parent, kind, outer | own)
        if place != "output" and kind == "String":
            ET.SubElement(element, "Start", value=start)
        elif place != "output":
            element.set("start", start)
    return f"{kind}.{place}", reference, len(parent)
