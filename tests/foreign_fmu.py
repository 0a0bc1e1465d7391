"""FMUs in the vehicle's place: a parrot of any description, and the vehicle under another one.

The parrot (tests/parrot_fmu) has every quantity of the loop as a plain number that is known
beforehand, echoes its inputs, and fails in every way that a well-behaved FMU never does.
"""

from __future__ import annotations

import re
import shutil
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from fmu_face import build, package, toolchain

from cosim.errors import Problem
from cosim.quantities import INPUT_QUANTITIES, OUTPUT_QUANTITIES

SOURCE: Final = Path(__file__).parent / "parrot_fmu" / "parrot.c"
OUTPUT, ECHO = 100, 200  # first value references, as in parrot.c

Edit = Callable[[ET.Element], None]

UNITS: Final[dict[str, dict[str, float]]] = {
    "1": {}, "m": {"m": 1}, "m/s": {"m": 1, "s": -1}, "m/s2": {"m": 1, "s": -2}, "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1}, "N": {"kg": 1, "m": 1, "s": -2},
    "km/h": {"m": 1, "s": -1, "factor": 1 / 3.6}, "deg": {"rad": 1, "factor": 0.017453292519943295},
    "%": {"factor": 0.01}, "g": {"m": 1, "s": -2, "factor": 9.81},
    "m above": {"m": 1, "offset": 250.0}, "% lifted": {"factor": 0.01, "offset": -0.5},
    "K": {"K": 1}, "Hz": {"s": -1},
}  # fmt: skip


@dataclass(frozen=True)
class Variable:
    """One variable of a model description; `unit` None declares none."""

    name: str
    reference: int
    causality: str = "output"
    unit: str | None = None
    type: str = "Float64"
    start: float | None = None
    limits: tuple[float, float] | None = None


ORDERS: Final = tuple(
    Variable(f"Parrot.{name}", 400 + i, "parameter", None, "Float64", 0.0, (0.0, 1e6))
    for i, name in enumerate(
        ("BadAt", "BadOutput", "BadValue", "FailAt", "FailStatus", "FailWords", "StopAt",
         "Chatter", "AbortAt", "SegfaultAt", "HangAt", "ExitAt", "HangAtStart", "OnlySoft")
    )
)  # fmt: skip
CLOCK: Final = (Variable("Parrot.Time", 300), Variable("Parrot.Step", 301))


def own_variables() -> dict[str, Variable]:
    """The loop's quantities under the names and units of the package's own vehicle, and orders."""
    outputs = [
        Variable(q.variable, OUTPUT + i, "output", q.unit) for i, q in enumerate(OUTPUT_QUANTITIES)
    ]
    inputs = [
        Variable(q.variable, i, "input", q.unit, start=0.0) for i, q in enumerate(INPUT_QUANTITIES)
    ]
    return {v.name: v for v in (*outputs, *inputs, *ORDERS, *CLOCK)}


def parrot(
    path: Path,
    variables: Sequence[Variable] | None = None,
    version: int = 3,
    units: Mapping[str, Mapping[str, float]] = UNITS,
) -> Path:
    """Write a parrot of these variables (default: the vehicle's own) as an FMU."""
    root = _description(variables or tuple(own_variables().values()), version, units)
    target = build.target_platform()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", ET.tostring(root))
        archive.writestr(package.binary_path("parrot", version, target), _binary(version))
    return path


def _description(
    variables: Sequence[Variable], version: int, units: Mapping[str, Mapping[str, float]]
) -> ET.Element:
    token = {2: "guid", 3: "instantiationToken"}[version]
    head = {"fmiVersion": f"{version}.0", "modelName": "Parrot", token: "{parrot}"}
    root = ET.Element("fmiModelDescription", head)
    ET.SubElement(root, "CoSimulation", modelIdentifier="parrot")
    definitions = ET.SubElement(root, "UnitDefinitions")
    for name, base in units.items():
        define_unit(definitions, name, base)
    parent = ET.SubElement(root, "ModelVariables")
    for variable in variables:
        _add(parent, variable, version)
    ET.SubElement(root, "ModelStructure")
    return root


def _add(parent: ET.Element, v: Variable, version: int) -> None:
    attributes = {"name": v.name, "valueReference": str(v.reference), "causality": v.causality}
    attributes |= {"variability": "fixed"} if v.causality == "parameter" else {}
    own: dict[str, Any] = {"unit": v.unit, "start": v.start}
    own |= dict(zip(("min", "max"), v.limits or (), strict=False))
    shown = {name: str(value) for name, value in own.items() if value is not None}
    if version == 3:
        ET.SubElement(parent, v.type, attributes | shown)
    else:
        kind = {"Float64": "Real", "Int32": "Integer"}.get(v.type, v.type)
        ET.SubElement(ET.SubElement(parent, "ScalarVariable", attributes), kind, shown)


@cache
def _binary(version: int) -> bytes:
    """The parrot's shared object; what it does not need to do is there, and refuses."""
    header = toolchain.header_directory() / f"fmi{version}Functions.h"
    names = re.findall(rf"#define (fmi{version}\w+) +fmi{version}FullName", header.read_text())
    refusals = "".join(f"__attribute__((weak)) int {n}(void) {{ return 3; }}\n" for n in names)
    folder = Path(tempfile.mkdtemp())
    try:
        (folder / "refusals.c").write_text(refusals)
        shutil.copy(SOURCE, folder)
        flags = [f"-DFMI{version}", "-fPIC", "-shared", "-Wall", "-Wextra", "-Werror"]
        command = [*build.compiler(None), *flags, "parrot.c", "refusals.c", "-lm", "-o", "parrot"]
        build.run_compiler(command, folder)
        return (folder / "parrot").read_bytes()
    finally:
        shutil.rmtree(folder)


# ---------------------------------------------------------------- another description


def repackage(source: Path, target: Path, edit: Edit) -> Path:
    """Write the FMU `source` with an edited model description."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                root = ET.fromstring(content)
                edit(root)
                content = ET.tostring(root)
            if not name.startswith(("sources/", "documentation/")):
                new.writestr(name, content)
    return target


def variables_of(root: ET.Element) -> dict[str, ET.Element]:
    """The variables' elements by name."""
    parent = root.find("ModelVariables")
    assert parent is not None
    return {str(element.get("name")): element for element in parent}


def set_unit(variable: ET.Element, unit: str) -> None:
    """Declare another unit; in FMI 2.0 it stands one level below the variable."""
    real = variable if variable.tag == "Float64" else variable[0]
    real.set("unit", unit)
    real.attrib.pop("displayUnit", None)


def define_unit(definitions: ET.Element, name: str, base: Mapping[str, float]) -> None:
    """Add a unit by its SI exponents, factor and offset."""
    unit = ET.SubElement(definitions, "Unit", name=name)
    ET.SubElement(unit, "BaseUnit", {key: repr(value) for key, value in base.items()})


# ---------------------------------------------------------------- in place of a scenario


@dataclass(frozen=True)
class Map:
    """What a scenario says of one quantity's variable."""

    name: str
    unit: str | None = None
    scale: float = 1.0


def report(
    key: tuple[str | int, ...], message: str, choices: Sequence[str] = (), name: str = ""
) -> Problem:
    """A problem that shows its place in the scenario as the key."""
    return Problem(f"{'.'.join(map(str, key))}: {message}")
