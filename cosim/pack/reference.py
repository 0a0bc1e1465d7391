"""The reference experiment of a packed FMU: the template has the stimuli, the FMU the result.

`extra/org.fmi-standard.fmi-ls-ref/` of the template (fmu/reference.py) holds the inputs, one row to
each step, and of the result only the names of its columns.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from cosim.fmi import Description, Slave

FOLDER: Final = "extra/org.fmi-standard.fmi-ls-ref"
STIMULI: Final = f"{FOLDER}/sensor_in.csv"
RESULT: Final = f"{FOLDER}/sensor_ref.csv"
MANIFEST: Final = f"{FOLDER}/fmi-ls-manifest.xml"
EVERY: Final = 8  # steps to a row of the result, as fmu/sensor/reference.toml has it


def reference_files(
    files: dict[str, bytes], absent: Collection[str], fmu: Path
) -> dict[str, bytes]:
    """Return stimuli, result and manifest of a packed FMU, which is run for them: `files` are the
    template's, `absent` the variables that it does not have. Raises `FmuError`.
    """
    names, rows = _read(files[STIMULI])
    kept = [i for i, name in enumerate(names) if name not in absent]
    names, rows = [names[i] for i in kept], [[row[i] for i in kept] for row in rows]
    outputs = [name for name in _read(files[RESULT])[0][1:] if name not in absent]
    found = {
        STIMULI: _written(names, rows),
        RESULT: _written(["time", *outputs], _run(fmu, names[1:], outputs, rows)),
    }
    return {**found, MANIFEST: _manifest(files[MANIFEST], files | found)}


def _run(
    fmu: Path, inputs: Sequence[str], outputs: Sequence[str], rows: Sequence[Sequence[float]]
) -> list[list[float]]:
    slave = Slave(Description(fmu), inputs, outputs)
    times = [row[0] for row in rows]
    result = []
    try:
        slave.inputs[:] = rows[0][1:]
        slave.initialise({})
        for k, row in enumerate(rows):
            if k % EVERY == 0:
                slave.read()
                result.append([row[0], *slave.outputs.tolist()])
            if k + 1 < len(rows):
                slave.inputs[:] = row[1:]
                slave.step(k, times[1] - times[0])
    finally:
        slave.close()
    return result


def _read(content: bytes) -> tuple[list[str], list[list[float]]]:
    header, *lines = content.decode().splitlines()
    return header.split(","), [[float(cell) for cell in line.split(",")] for line in lines]


def _written(names: Sequence[str], rows: Sequence[Sequence[float]]) -> bytes:
    lines = [",".join(names), *(",".join(map(repr, row)) for row in rows)]
    return ("\n".join(lines) + "\n").encode()


def _manifest(xml: bytes, files: dict[str, bytes]) -> bytes:
    """Return the manifest with the checksums of the files as they are now."""
    root = ET.fromstring(xml)
    ET.register_namespace("fmi-ls", "http://fmi-standard.org/fmi-ls-manifest")
    for related in root.iter("Related"):
        content = files[f"{FOLDER}/{related.get('source')}"]
        related.set("checksum", hashlib.sha3_256(content).hexdigest())
    body: bytes = ET.tostring(root, encoding="utf-8")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + body + b"\n"
