"""A trained network into an FMU: the package's template, the network's bytes, other binaries."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cosim.errors import InputError
from cosim.pack.archive import write_fmu
from cosim.pack.description import TERMINALS, Identity, model_description, terminals
from cosim.pack.documents import documents
from cosim.pack.platforms import binaries
from cosim.pack.record import record, sentence
from cosim.pack.reference import reference_files
from cosim.pack.template import DESCRIPTION, NETWORK, read_template, token_of
from cosim.pack.trial import compare
from cosim.sensor_fmu import DEVIATIONS
from sensor.channels import COMMANDS
from sensor.errors import SensorError
from sensor.packed import blob, read_network


@dataclass(frozen=True)
class Packed:
    """A packed FMU: where it is, what it says of its network, the platforms of its binaries, and
    the largest difference of its estimates from the network's [m/s].
    """

    path: Path
    description: str
    platforms: tuple[str, ...]
    difference: float


def pack(model: Path, out: Path, fmi: int = 3, platforms: Sequence[str] = ()) -> Packed:
    """Write the network in the ONNX file `model` as the sensor FMU `out`, FMI 2.0 or 3.0.

    The FMU has the binary of this machine and of `platforms`. It is run beside the network before
    it takes its place; nothing is written otherwise. Raises `SensorError` for a network that cannot
    be packed, `InputError` for a platform or a place that cannot be, `NetworkError` if FMU and
    network differ.
    """
    _check_place(out)
    template = read_template(fmi)
    others = binaries(template, platforms)
    network = read_network(model)
    try:
        packed = blob(network)
    except SensorError as error:
        raise SensorError(f"{model}: {error}") from error
    absent = frozenset() if network.kind == "carried" else _of_carried_networks()
    identity = Identity(
        f"Sensor {model.stem}", sentence(model.name, network), token_of(template, packed), absent
    )
    files = {**template.files, NETWORK: packed}
    files[DESCRIPTION] = model_description(files[DESCRIPTION], identity)
    files[TERMINALS] = terminals(files[TERMINALS], absent)
    files |= documents(files, record(model, network), identity.name, absent)
    with tempfile.TemporaryDirectory() as name:
        trial = Path(name, "sensor.fmu")
        write_fmu(trial, files, compressed=False)
        difference = compare(trial, model, network.window)
        files |= reference_files(files, absent, trial)
    _write(out, files | others)
    there = sorted({path.split("/")[1] for path in files | others if path.startswith("binaries/")})
    return Packed(out, identity.description, tuple(there), difference)


def _check_place(out: Path) -> None:
    """Raise `InputError` where no FMU can be written, before there is any work."""
    if out.suffix != ".fmu":
        raise InputError(f"'{out}': the name of an FMU ends in .fmu")
    if out.is_dir():
        raise InputError(f"'{out}' is a folder; give the name of a file")
    if not out.parent.is_dir():
        raise InputError(f"'{out}': there is no folder '{out.parent}'")


def _write(out: Path, files: dict[str, bytes]) -> None:
    part = out.with_name(f".{out.name}.part")
    try:
        write_fmu(part, files)
        part.replace(out)
    except OSError as error:
        raise InputError(f"cannot write '{out}': {error.strerror or error}") from None
    finally:
        part.unlink(missing_ok=True)


def _of_carried_networks() -> frozenset[str]:
    """Return the variables that windowed networks do not have."""
    return frozenset({*(command.name for command in COMMANDS), *DEVIATIONS})
