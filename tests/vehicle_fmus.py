"""The vehicle FMUs as they are shipped: archives, descriptions, unzipped folders."""

from __future__ import annotations

import shutil
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import fmpy

from cosim.vehicle import builtin_fmu

VERSIONS = (2, 3)


@cache
def names(version: int) -> frozenset[str]:
    """The entries of the archive."""
    with zipfile.ZipFile(builtin_fmu(version)) as archive:
        return frozenset(archive.namelist())


def entry(version: int, name: str) -> bytes:
    """One file of the archive."""
    with zipfile.ZipFile(builtin_fmu(version)) as archive:
        return archive.read(name)


def xml(version: int, name: str = "modelDescription.xml") -> ET.Element:
    """The root of one XML file of the archive."""
    return ET.fromstring(entry(version, name))


@cache
def description(version: int) -> Any:
    """FMPy's reading of the model description."""
    return fmpy.read_model_description(str(builtin_fmu(version)))


@cache
def variables(version: int) -> dict[str, Any]:
    """The variables by name."""
    return {v.name: v for v in description(version).modelVariables}


@contextmanager
def unzipped(version: int, prefix: str = "") -> Iterator[Path]:
    """The FMU in a folder of its own."""
    folder = Path(tempfile.mkdtemp(prefix=prefix))
    try:
        fmpy.extract(str(builtin_fmu(version)), unzipdir=str(folder))
        yield folder
    finally:
        shutil.rmtree(folder)
