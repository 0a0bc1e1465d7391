"""The FMUs as they are shipped, vehicle and packed sensors: archives, descriptions, folders.

Two sensors have small networks of random weights: what counts there is how the FMU goes about it.
"""

from __future__ import annotations

import atexit
import shutil
import tempfile
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import fmpy

from cosim.pack.packing import pack
from cosim.vehicle import builtin_fmu
from sensor.estimators import MODELS

VERSIONS = (2, 3)
KINDS = ("windowed", "carried")
WINDOW = 19  # of both windowed ones


@dataclass(frozen=True)
class Shipped:
    """The vehicle FMU or a packed sensor, of one FMI version."""

    model: str  # "vehicle", "windowed" or "carried", or these two with "small " before
    version: int

    def __str__(self) -> str:
        return f"{self.model}-fmi{self.version}"

    @property
    def identifier(self) -> str:
        """Of the model in the FMU."""
        return "vehicle" if self.model == "vehicle" else "sensor"

    @property
    def path(self) -> Path:
        """The FMU; a sensor is packed when it is first asked for."""
        if self.model == "vehicle":
            return builtin_fmu(self.version)
        return sensor_fmu(self.network, self.version)

    @property
    def carried(self) -> bool:
        """Whether it is a sensor whose network carries a state."""
        return self.model.endswith("carried")

    @property
    def network(self) -> Path:
        """The ONNX file of a sensor."""
        shipped = {"windowed": "bilstm_w19_ideal", "carried": "carried_ideal"}
        if self.model in shipped:
            return MODELS / f"{shipped[self.model]}.onnx"
        return small_network(self.carried)


VEHICLES = tuple(Shipped("vehicle", version) for version in VERSIONS)
SENSORS = tuple(Shipped(kind, version) for kind in KINDS for version in VERSIONS)
SMALL = tuple(Shipped(f"small {kind}", version) for kind in KINDS for version in VERSIONS)
ALL = (*VEHICLES, *SENSORS)


@cache
def _folder() -> Path:
    """Where packed FMUs lie until the end of the tests."""
    folder = Path(tempfile.mkdtemp(prefix="packed-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@cache
def sensor_fmu(network: Path, version: int) -> Path:
    """A network as an FMU, packed once for all tests of a run."""
    return pack(network, _folder() / f"{network.stem}.fmi{version}.fmu", version).path


@cache
def small_network(carried: bool) -> Path:
    """A network of random weights, of a few kB."""
    from packed_sensor import carried_network, exported, windowed_network

    made = carried_network(8, 12, 6) if carried else windowed_network(WINDOW, 12, 8, True)
    path = exported(made, _folder())
    return path.rename(path.with_stem(f"small_{'carried' if carried else 'windowed'}"))


@cache
def names(fmu: Shipped) -> frozenset[str]:
    """The entries of the archive."""
    with zipfile.ZipFile(fmu.path) as archive:
        return frozenset(archive.namelist())


def entry(fmu: Shipped, name: str) -> bytes:
    """One file of the archive."""
    with zipfile.ZipFile(fmu.path) as archive:
        return archive.read(name)


def xml(fmu: Shipped, name: str = "modelDescription.xml") -> ET.Element:
    """The root of one XML file of the archive."""
    return ET.fromstring(entry(fmu, name))


@cache
def description(fmu: Shipped) -> Any:
    """FMPy's reading of the model description."""
    return fmpy.read_model_description(str(fmu.path))


@cache
def variables(fmu: Shipped) -> dict[str, Any]:
    """The variables by name."""
    return {v.name: v for v in description(fmu).modelVariables}


@contextmanager
def unzipped(fmu: Shipped, prefix: str = "") -> Iterator[Path]:
    """The FMU in a folder of its own."""
    folder = Path(tempfile.mkdtemp(prefix=prefix))
    try:
        fmpy.extract(str(fmu.path), unzipdir=str(folder))
        yield folder
    finally:
        shutil.rmtree(folder)
