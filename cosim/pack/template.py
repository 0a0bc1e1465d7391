"""The sensor FMU without a network, which comes with the package: what every packed FMU starts
from.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from cosim.errors import FmuError

DESCRIPTION: Final = "modelDescription.xml"
NETWORK: Final = "resources/network.bin"
IDENTIFIER: Final = "sensor"


@dataclass(frozen=True)
class Template:
    """The files of the FMU by their path, its FMI version (2 or 3) and the token of its binaries,
    `{8-4-4-4-12 hexadecimal digits}`.
    """

    fmi: int
    files: dict[str, bytes]
    token: str


def read_template(fmi: int) -> Template:
    """Return the package's sensor FMU; raises `FmuError` if it was never built."""
    path = Path(str(resources.files("cosim") / "fmus" / f"{IDENTIFIER}.fmi{fmi}.fmu"))
    if not path.is_file():
        raise FmuError(f"{path}: missing; build it with 'pip install .' or 'python fmu/build.py'")
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    root = ET.fromstring(files[DESCRIPTION])
    token = str(root.get("guid" if fmi == 2 else "instantiationToken"))
    return Template(fmi, files, token)


def token_of(template: Template, blob: bytes) -> str:
    """Return the token of the template with a network: the second half is the FNV-1a checksum of
    the network's first 64 bytes, its header, which has a checksum of the rest (fmu/sensor).
    """
    checksum = 14695981039346656037
    for byte in blob[:64]:
        checksum = (checksum ^ byte) * 1099511628211 % 2**64
    digits = f"{checksum:016x}"
    return f"{template.token[:20]}{digits[:4]}-{digits[4:]}}}"
