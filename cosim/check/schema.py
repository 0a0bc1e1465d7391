"""XML against the schemas of the standard, which FMPy brings along; each error with its line."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from cosim.check.archive import MODEL_DESCRIPTION, Archive
from cosim.check.finding import Finding

SCHEMAS = {
    (2, MODEL_DESCRIPTION): "fmi2ModelDescription.xsd",
    (3, MODEL_DESCRIPTION): "fmi3ModelDescription.xsd",
    (3, "sources/buildDescription.xml"): "fmi3BuildDescription.xsd",
    (3, "terminalsAndIcons/terminalsAndIcons.xml"): "fmi3TerminalsAndIcons.xsd",
}


def fmpy_folder() -> Path:
    """Return the folder of the FMPy package, without importing it."""
    spec = importlib.util.find_spec("fmpy")
    if spec is None or not spec.submodule_search_locations:
        raise ModuleNotFoundError("FMPy is not installed")
    return Path(spec.submodule_search_locations[0])


def parse(archive: Archive, name: str) -> Any:
    """Return the root of an XML entry. Raises `XmlError` for what is no XML."""
    from lxml import etree

    parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True)
    try:
        return etree.fromstring(archive.read(name), parser)
    except etree.XMLSyntaxError as error:
        line = error.lineno or 1
        text = re.sub(r", line \d+, column \d+.*", "", str(error.msg or error))
        raise XmlError(
            Finding("xml-syntax", f"{name}:{line}", f"{name} is no well-formed XML: {text}")
        ) from None


class XmlError(Exception):
    """An XML file cannot be read; holds the finding that says why."""

    def __init__(self, finding: Finding) -> None:
        self.finding = finding
        super().__init__(finding.message)


def schema_findings(root: Any, major: int, name: str) -> Iterator[Finding]:
    """Yield one finding for each error that the schema of this file has."""
    file = SCHEMAS.get((major, name))
    if file is None:
        return
    schema = _schema(major, file)
    if schema.validate(root):
        return
    seen = set()
    for entry in schema.error_log:
        text = _plain(entry.message)
        if (entry.line, text) not in seen:
            seen.add((entry.line, text))
            yield Finding("schema", f"{name}:{entry.line}", text)


@cache
def _schema(major: int, file: str) -> Any:
    from lxml import etree

    return etree.XMLSchema(file=str(fmpy_folder() / "schema" / f"fmi{major}" / file))


def _plain(message: str) -> str:
    """Return libxml2's message without the jargon around it."""
    text = re.sub(r"\[facet '\w+'\] ", "", message)
    text = re.sub(r"The value '(.*?)' is not an element of the set \{(.*?)\}\.",
                  r"'\1' is none of \2.", text)  # fmt: skip
    text = text.replace("is not a valid value of the atomic type", "is not a value of type")
    return " ".join(text.split())
