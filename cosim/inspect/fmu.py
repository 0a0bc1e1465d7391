"""What is inside an FMU: identity, platforms, capabilities, variables, and what it can serve."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any, Final

from cosim.check.archive import MODEL_DESCRIPTION, Archive
from cosim.check.binaries import meaning, platforms
from cosim.check.contents import TERMINALS
from cosim.check.description import Description
from cosim.check.finding import listed
from cosim.check.parts import Variable
from cosim.check.schema import XmlError, parse
from cosim.errors import InputError
from cosim.inspect.facts import Facts, number, size_of
from cosim.inspect.service import service, show_service

NETWORK_RECORD: Final = "extra/org.suspension-cosim/network.json"
LISTS: Final = {
    "Inputs": ("input",), "Outputs": ("output",),
    "Parameters": ("parameter", "structuralParameter"),
}  # fmt: skip
_COLUMNS: Final = ("name", "type", "unit", "start", "min", "max", "description")


def inspect(path: Path, limit: int = 0) -> Facts:
    """Return the facts of an FMU; lists of variables end after `limit` rows if it is above 0.

    Raises `InputError` if its model description cannot be read.
    """
    archive = Archive(path)
    try:
        description = _description(archive)
        data = _data(archive, description)
    finally:
        archive.close()
    name = f"{data['model_name']}, " if data["model_name"] else ""
    facts = Facts(f"{path}: FMU, FMI {data['fmi_version']}, {name}{size_of(data['bytes'])}", data)
    _identity(facts)
    folders = [(name, size_of(size)) for name, size in data["folders"].items()]
    facts.table("Size by folder (unpacked)", ("folder", "size"), folders)
    counts = [(causality, str(n)) for causality, n in data["counts"].items()]
    facts.table("Variables", ("causality", "number"), counts)
    for title, causalities in LISTS.items():
        rows = [_row(v) for v in data["variables"] if v["causality"] in causalities]
        facts.table(title, _COLUMNS, rows, limit)
    terminals = [
        (t["name"], t["kind"], str(len(t["members"])), listed(t["members"], 4))
        for t in data["terminals"]
    ]
    facts.table("Terminals", ("name", "kind", "members", "variables"), terminals, limit)
    _network(facts)
    show_service(facts)
    return facts


def _description(archive: Archive) -> Description:
    name = MODEL_DESCRIPTION if MODEL_DESCRIPTION in archive else ""
    name = name or archive.other_case(MODEL_DESCRIPTION) or ""
    try:
        root = parse(archive, name) if name else None
    except XmlError as error:
        raise InputError(f"{archive.path}: {error.finding.where}: {error}") from None
    except Exception as error:  # an entry that cannot be unpacked
        raise InputError(f"{archive.path}: {name} cannot be read: {error}") from None
    if root is None:
        raise InputError(
            f"{archive.path}: {MODEL_DESCRIPTION} is not at the top of the archive; zip the "
            "content of the FMU's folder, not the folder"
        )
    version = str(root.get("fmiVersion") or "none")
    if not version.startswith(("2.", "3.")):
        raise InputError(f"{archive.path}: an FMU of FMI {version}; FMI 2.0 and 3.0 are read here")
    return Description(root)


def _data(archive: Archive, description: Description) -> dict[str, Any]:
    root = description.root
    folders: Counter[str] = Counter()
    for info in archive.infos:
        top, _, rest = info.filename.partition("/")
        folders[top if rest else "(top)"] += info.file_size
    interfaces = ("CoSimulation", "ModelExchange", "ScheduledExecution")
    simulation = description.simulation
    attributes = {} if simulation is None else dict(simulation.attrib)
    attributes.pop("modelIdentifier", None)
    experiment = description.experiment
    return {
        "kind": "fmu",
        "file": str(archive.path),
        "bytes": archive.path.stat().st_size,
        "fmi_version": description.version,
        "model_name": description.name,
        "model_identifier": description.identifier,
        "token": description.token,
        **{
            key: root.get(attribute)
            for key, attribute in {
                "description": "description", "author": "author", "version": "version",
                "license": "license", "copyright": "copyright",
                "generation_tool": "generationTool", "generation_date": "generationDateAndTime",
            }.items()
        },
        "interfaces": [kind for kind in interfaces if root.find(kind) is not None],
        "platforms": platforms(archive),
        "capabilities": attributes,
        "default_experiment": {} if experiment is None else dict(experiment.attrib),
        "folders": dict(sorted(folders.items())),
        "counts": dict(Counter(v.causality for v in description.variables)),
        "variables": [_variable(v) for v in description.variables],
        "units": [unit.name for unit in description.units],
        "terminals": _terminals(archive),
        "licences": [
            f"{folder}/{name}"
            for folder in ("documentation/licenses", "documentation/licences", "licenses")
            for name in archive.below(folder)
        ],
        "sources": len([n for n in archive.below("sources") if n.endswith((".c", ".cpp"))]),
        "serves": service(description),
        "network": _record(archive),
    }  # fmt: skip


def _variable(v: Variable) -> dict[str, Any]:
    return {
        "name": v.name, "type": v.type, "causality": v.causality, "variability": v.variability,
        "unit": v.unit, "display_unit": v.display_unit,
        "start": v.start if v.starts is None or len(v.starts) == 1 else list(v.starts),
        "min": v.minimum, "max": v.maximum, "nominal": v.nominal, "elements": v.size,
        "value_reference": v.reference, "description": v.description,
    }  # fmt: skip


def _terminals(archive: Archive) -> list[dict[str, Any]]:
    if TERMINALS not in archive:
        return []
    try:
        root = parse(archive, TERMINALS)
    except XmlError:
        return []
    return [
        {
            "name": str(t.get("name")),
            "kind": str(t.get("terminalKind") or ""),
            "members": [str(m.get("variableName")) for m in t.iter("TerminalMemberVariable")],
        }
        for t in root.iter("Terminal")
    ]


def _identity(facts: Facts) -> None:
    d = facts.data
    flags = [name for name, value in d["capabilities"].items() if value in ("true", "1")]
    values = [
        f"{name} {value}"
        for name, value in d["capabilities"].items()
        if value not in ("true", "1", "false", "0")
    ]
    systems = [f"{p} ({' '.join(meaning(p) or ('unknown',)).strip()})" for p in d["platforms"]]
    experiment = d["default_experiment"]
    names = {"startTime": "start", "stopTime": "stop", "stepSize": "step",
             "tolerance": "tolerance"}  # fmt: skip
    times = [
        f"{names.get(key, key)} {value}{'' if key == 'tolerance' else ' s'}"
        for key, value in experiment.items()
    ]
    facts.pairs(
        "Identity",
        [
            ("description", d["description"] or ""),
            ("model identifier", d["model_identifier"]),
            ("token", d["token"]),
            ("version", d["version"] or ""),
            ("author", d["author"] or ""),
            ("generated by", d["generation_tool"] or ""),
            ("generated on", d["generation_date"] or "not said"),
            ("licence", d["license"] or d["copyright"] or ""),
            ("licence files", listed(d["licences"])),
            ("interfaces", ", ".join(d["interfaces"])),
            ("platforms", ", ".join(systems) or "none"),
            ("sources", f"{d['sources']} C files" if d["sources"] else ""),
            ("can", ", ".join([*flags, *values]) or "nothing beyond the minimum"),
            ("default experiment", ", ".join(times)),
        ],
    )


def _record(archive: Archive) -> dict[str, Any]:
    """Return what a packed sensor (cosim pack) says of its network, {} of any other FMU."""
    if NETWORK_RECORD not in archive:
        return {}
    try:
        found = json.loads(archive.read(NETWORK_RECORD))
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _network(facts: Facts) -> None:
    """The record without what its file says of the training: inspect the ONNX file for that."""
    plain = [
        (key.replace("_", " "), str(value))
        for key, value in facts.data["network"].items()
        if isinstance(value, str | int | float)
    ]
    facts.pairs("Network", plain)


def _row(v: dict[str, Any]) -> tuple[str, ...]:
    start = v["start"] if isinstance(v["start"], str) else listed(v["start"] or [], 4)
    elements = f"[{v['elements']}]" if v["elements"] != 1 else ""
    return (
        v["name"], v["type"] + elements, v["unit"] or "", start, number(v["min"]),
        number(v["max"]), v["description"],
    )  # fmt: skip
