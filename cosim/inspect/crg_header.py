"""The header of an OpenCRG file as it is written: blocks, keywords, columns (ASAM OpenCRG 1.2)."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

FORMATS: Final = {
    "KRBI": "binary, single precision", "KDBI": "binary, double precision",
    "LRFI": "text, 10 characters a number", "LDFI": "text, 20 characters a number",
}  # fmt: skip
_MOST: Final = 1 << 20  # bytes of a header
_NUMBER: Final = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?"


@dataclass
class Header:
    """Comment lines; keywords of $ROAD_CRG, $ROAD_CRG_MODS and $ROAD_CRG_OPTS by lower-case name;
    format; the channels' definitions; places of the columns across [m].

    `modifiers` is None where the file has no such block.
    """

    comment: list[str] = field(default_factory=list)
    road: dict[str, float] = field(default_factory=dict)
    modifiers: dict[str, float] | None = None
    options: dict[str, float] = field(default_factory=dict)
    reference: str = ""
    format: str = ""
    channels: list[str] = field(default_factory=list)
    columns: list[float] = field(default_factory=list)

    @property
    def curves(self) -> bool:
        """Whether the reference line has a heading of its own along the road."""
        return any("phi" in channel.lower() for channel in self.channels)


def read_header(path: Path) -> Header:
    """Return the header of an OpenCRG file; what is not understood is left out."""
    with path.open("rb") as file:
        text = file.read(_MOST).decode("latin-1")
    header, block = Header(), ""
    for raw in text.splitlines():
        line = raw.rstrip()
        if line.startswith("$$$$"):
            break
        if line.startswith("$"):
            block = line[1:].split("!")[0].split("*")[0].strip().upper()
            if block == "ROAD_CRG_MODS":
                header.modifiers = {}
            continue
        _line(header, block, line)
    return header


def _line(header: Header, block: str, line: str) -> None:
    if block == "CT":
        if line.strip():
            header.comment.append(line.strip())
        return
    if line.startswith("*") or not line.strip():
        return
    if block == "KD_DEFINITION":
        _definition(header, line)
        return
    match = re.match(rf"\s*(\w+)\s*=\s*({_NUMBER})", line)
    target = {
        "ROAD_CRG": header.road, "ROAD_CRG_MODS": header.modifiers, "ROAD_CRG_OPTS": header.options,
    }.get(block)  # fmt: skip
    if match and target is not None:
        target[match[1].lower()] = float(match[2].upper().replace("D", "E"))
    elif block == "ROAD_CRG_FILE":
        header.reference += line.strip()


def _definition(header: Header, line: str) -> None:
    code = re.match(r"#:\s*(\w+)", line)
    if code:
        header.format = code[1].upper()
    elif line[:2].upper() in ("D:", "U:"):
        header.channels.append(line[2:].strip())
        at = re.search(rf"at\s+v\s*=\s*({_NUMBER})", line, re.I)
        if at:
            header.columns.append(float(at[1]))
