"""The files that the XML names: sources, build description, terminals, resources, token."""

from __future__ import annotations

import posixpath
import re
from collections import Counter
from collections.abc import Iterator
from typing import Any, Final

from cosim.check.archive import MODEL_DESCRIPTION, Archive
from cosim.check.description import Description
from cosim.check.finding import Finding, listed
from cosim.check.schema import XmlError, parse, schema_findings
from cosim.check.variables import place
from cosim.errors import did_you_mean

BUILD: Final = "sources/buildDescription.xml"
TERMINALS: Final = "terminalsAndIcons/terminalsAndIcons.xml"
_FILE_NAME: Final = re.compile(r"(?:[\w .()+-]+[/\\])*[\w .()+-]*[A-Za-z_]\.[A-Za-z]\w{1,4}")
_ABSOLUTE: Final = re.compile(r"(?:[A-Za-z]:[\\/]|/)[\w .()+-]+[\\/].*")


def source_findings(archive: Archive, description: Description) -> Iterator[Finding]:
    """Yield what the lists of source files name and the archive lacks."""
    if description.major == 2:
        for interface in ("CoSimulation", "ModelExchange"):
            for element in description.root.findall(f"{interface}/SourceFiles/File"):
                where = f"{MODEL_DESCRIPTION}:{element.sourceline}"
                yield from _source(archive, str(element.get("name")), where, "SourceFiles")
        return
    sources = [name for name in archive.below("sources") if name.endswith((".c", ".cc", ".cpp"))]
    yield from _spelt(archive, BUILD)
    if BUILD not in archive:
        if sources and not archive.other_case(BUILD):
            yield Finding(
                "build-description-missing", "sources/",
                f"sources/ holds {len(sources)} C files but no buildDescription.xml; without it no "
                "tool knows how to compile them",
            )  # fmt: skip
        return
    try:
        root = parse(archive, BUILD)
    except XmlError as error:
        yield error.finding
        return
    yield from schema_findings(root, 3, BUILD)
    yield from _build_description(archive, description, root)


def _build_description(archive: Archive, description: Description, root: Any) -> Iterator[Finding]:
    for element in root.iter("SourceFile", "PreprocessorDefinition", "IncludeDirectory"):
        name, where = str(element.get("name")), f"{BUILD}:{element.sourceline}"
        if element.tag == "SourceFile":
            yield from _source(archive, name, where, "buildDescription")
        elif element.tag == "IncludeDirectory" and not archive.below(f"sources/{name}"):
            yield Finding(
                "source-missing", where,
                f"buildDescription names the include directory '{name}', which sources/ lacks",
            )  # fmt: skip
    known = {
        str(description.root.find(kind).get("modelIdentifier"))
        for kind in ("CoSimulation", "ModelExchange", "ScheduledExecution")
        if description.root.find(kind) is not None
    }
    for element in root.findall("BuildConfiguration"):
        identifier = str(element.get("modelIdentifier"))
        if identifier not in known:
            yield Finding(
                "build-identifier", f"{BUILD}:{element.sourceline}",
                f"the BuildConfiguration is for modelIdentifier '{identifier}', but "
                f"{MODEL_DESCRIPTION} has {listed(sorted(known))}",
            )  # fmt: skip


def _source(archive: Archive, name: str, where: str, list_name: str) -> Iterator[Finding]:
    path = posixpath.normpath(f"sources/{name}")
    if path in archive:
        return
    other = archive.other_case(path)
    if other:
        yield Finding(
            "wrong-case", where,
            f"{list_name} names '{name}', but the file is '{other.removeprefix('sources/')}': "
            "names are case-sensitive on Linux",
        )  # fmt: skip
    else:
        hint = did_you_mean(name, archive.below("sources"))
        yield Finding(
            "source-missing", where, f"{list_name} names '{name}', which sources/ lacks{hint}"
        )


def _spelt(archive: Archive, name: str) -> Iterator[Finding]:
    other = archive.other_case(name)
    if other and other.split("/")[0] == name.split("/")[0]:
        yield Finding("wrong-case", other, f"'{other}' must be spelt '{name}'")


# ---------------------------------------------------------------- terminals


def terminal_findings(archive: Archive, description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the terminals: absent variables, doubled names, missing icons."""
    yield from _spelt(archive, TERMINALS)
    if TERMINALS not in archive:
        return
    try:
        root = parse(archive, TERMINALS)
    except XmlError as error:
        yield error.finding
        return
    yield from schema_findings(root, description.major, TERMINALS)
    for element in root.iter("Terminal"):
        yield from _terminal(element, description)
    yield from _doubled(root.findall("Terminals/Terminal"), "the terminals")
    for element in root.iter("Icon"):
        icon = f"terminalsAndIcons/{element.get('iconBaseName', 'icon')}.png"
        if icon not in archive:
            yield Finding(
                "icon-missing", f"{TERMINALS}:{element.sourceline}", f"the icon '{icon}' is missing"
            )


def _terminal(element: Any, description: Description) -> Iterator[Finding]:
    name = element.get("name")
    members = [e for e in element if str(e.tag).endswith("MemberVariable")]
    for member in members:
        for attribute in ("variableName", "inStreamVariableName", "outStreamVariableName"):
            variable = member.get(attribute)
            if variable is not None and variable not in description.by_name:
                hint = did_you_mean(variable, description.by_name)
                yield Finding(
                    "terminal-variable", f"{TERMINALS}:{member.sourceline}",
                    f"terminal '{name}' names the variable '{variable}', which does not exist"
                    f"{hint}",
                )  # fmt: skip
    yield from _doubled(element.findall("Terminal"), f"the parts of terminal '{name}'")
    yield from _doubled(members, f"the members of terminal '{name}'", "memberName")


def _doubled(elements: list[Any], what: str, attribute: str = "name") -> Iterator[Finding]:
    names = [e.get(attribute) for e in elements if e.get(attribute) is not None]
    for name, count in Counter(names).items():
        if count > 1:
            line = [e for e in elements if e.get(attribute) == name][1].sourceline
            yield Finding(
                "terminal-duplicate", f"{TERMINALS}:{line}",
                f"{count} of {what} are called '{name}'",
            )  # fmt: skip


# ---------------------------------------------------------------- resources


def resource_findings(archive: Archive, description: Description) -> Iterator[Finding]:
    """Yield start values of text parameters that look like files which the FMU does not hold."""
    resources = archive.below("resources")
    for v in description.variables:
        text = v.start or ""
        if v.type != "String" or v.causality not in ("parameter", "structuralParameter"):
            continue
        if _ABSOLUTE.fullmatch(text):
            yield Finding(
                "absolute-path", place(v),
                f"{v.name}: its start value '{text}' is an absolute path, which only the exporting "
                "machine has; put the file into resources/",
            )  # fmt: skip
        elif _FILE_NAME.fullmatch(text):
            wanted = text.replace("\\", "/").removeprefix("./").removeprefix("resources/")
            if f"resources/{wanted}" in archive:
                continue
            other = archive.other_case(f"resources/{wanted}")
            if other:
                yield Finding(
                    "wrong-case", place(v),
                    f"{v.name}: its start value '{text}' is spelt '{other}' in the archive: names "
                    "are case-sensitive on Linux",
                )  # fmt: skip
            else:
                yield Finding(
                    "resource-missing", place(v),
                    f"{v.name}: its start value '{text}' looks like a file, which resources/ lacks"
                    f"{did_you_mean(wanted, resources)}",
                )  # fmt: skip
