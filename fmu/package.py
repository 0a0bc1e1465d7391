"""What is in an FMU's archive, for both FMI versions; the same input gives the same bytes."""

import hashlib
import tomllib
import zipfile
from pathlib import Path

import describe
import documents
import generate
import reference
import states
from table import Table
from toolchain import PORTABLE, BuildError, belongs, c_files, header_directory, target_platform
from variables import read_table

FMU_DIRECTORY = Path(__file__).resolve().parent
COMMON = FMU_DIRECTORY / "common"
# An importer compiles against headers of its own, so the standard keeps them out of sources/.
HEADERS = "extra/org.suspension-cosim/fmi-headers"
HEADERS_LICENCE = f"""
The files in {HEADERS}/ are those of the FMI standard, under the licence that stands in each of
them: Copyright (C) Modelica Association Project "FMI", 2-Clause BSD License.
"""
ZIP_TIME = (1980, 1, 1, 0, 0, 0)


def project_version() -> str:
    """Version of the project, from pyproject.toml."""
    project = FMU_DIRECTORY.parent / "pyproject.toml"
    if not project.is_file():
        return "0"
    return str(tomllib.loads(project.read_text(encoding="utf-8"))["project"].get("version", "0"))


def binary_path(identifier: str, fmi: int, target: str) -> str:
    """Where an FMU keeps its shared object: FMI 2 knows only system and word size."""
    system = target.partition("-")[2]
    suffix = {"darwin": ".dylib", "windows": ".dll"}.get(system, ".so")
    fmi2_name = {"darwin": "darwin64", "windows": "win64"}.get(system, "linux64")
    return f"binaries/{fmi2_name if fmi == 2 else target}/{identifier}{suffix}"


def written_sources(model: Path, fmi: int) -> dict[str, bytes]:
    """The written C files of one FMI version by name, model and ceremony together."""
    files: dict[str, bytes] = {}
    for directory in (COMMON, model):
        for path in sorted([*directory.glob("*.c"), *directory.glob("*.h")]):
            if path.name in files:
                raise BuildError(f"{path}: fmu/common has a file of the same name.")
            if belongs(path.name, fmi):
                files[path.name] = path.read_bytes()
    return files


def instantiation_token(model: Path) -> str:
    """A GUID that changes whenever table or sources do."""
    digest = hashlib.sha256((model / "variables.toml").read_bytes())
    for name, content in sorted({**written_sources(model, 2), **written_sources(model, 3)}.items()):
        digest.update(name.encode() + b"\0" + content)
    h = digest.hexdigest()
    return f"{{{h[:8]}-{h[8:12]}-{h[12:16]}-{h[16:20]}-{h[20:32]}}}"


def package_sources(model: Path, table: Table, fmi: int) -> dict[str, bytes]:
    """What sources/ holds, by file name: everything but the FMI headers."""
    files = written_sources(model, fmi)
    files["variables.h"] = generate.header(table).encode()
    files["variables.c"] = generate.source(table, instantiation_token(model)).encode()
    return files


def fmi_headers(fmi: int) -> dict[str, bytes]:
    """The standard's C headers by file name."""
    return {
        path.name: path.read_bytes() for path in sorted(header_directory().glob(f"fmi{fmi}*.h"))
    }


def compiled_sources(model: Path, table: Table) -> dict[str, bytes]:
    """Everything a compiler needs for both FMI versions, by file name."""
    files: dict[str, bytes] = {}
    for fmi in (2, 3):
        files |= package_sources(model, table, fmi) | fmi_headers(fmi)
    return files


def folder_files(folder: Path, prefix: str) -> dict[str, bytes]:
    """All files below a folder, if it exists, by their path in the FMU."""
    return {
        f"{prefix}/{path.relative_to(folder).as_posix()}": path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def fmu_contents(model: Path, fmi: int, binary: bytes, target: str) -> dict[str, bytes]:
    """Every file of an FMU by its path.

    With a ``reference.toml`` that is the result of the reference experiment too, unless the binary
    is for another machine.
    """
    table = read_table(model / "variables.toml")
    token, version = instantiation_token(model), project_version()
    sources = package_sources(model, table, fmi)
    build_description = documents.build_description(table, c_files(sources), PORTABLE)
    files = {f"sources/{name}": content for name, content in sources.items()}
    files |= {f"{HEADERS}/{name}": content for name, content in fmi_headers(fmi).items()}
    files |= {
        "modelDescription.xml": describe.fmi2(table, version, token, c_files(sources))
        if fmi == 2
        else describe.fmi3(table, version, token),
        binary_path(table.model["identifier"], fmi, target): binary,
        "sources/buildDescription.xml": build_description,
        "documentation/index.html": documents.index(table, version, fmi, HEADERS, _notes(model)),
    }
    for folder in ("resources", "extra"):
        files |= folder_files(model / folder, folder)
    header = model / f"{table.model['identifier']}.h"
    layout = states.state_table(header.read_text(encoding="utf-8")) if header.is_file() else None
    if layout:
        files[states.STATE_TABLE] = layout
    files.setdefault(
        "resources/README.txt", b"Files named by a relative path are looked for here.\n"
    )
    licence = FMU_DIRECTORY.parent / "LICENSE"
    if licence.is_file():
        own = licence.read_bytes()
        files["documentation/licenses/license.txt"] = own + HEADERS_LICENCE.encode()
    if table.terminals:
        files["terminalsAndIcons/terminalsAndIcons.xml"] = documents.terminals(table)
    return files | _reference(model, table, files, fmi, target)


def _notes(model: Path) -> str:
    """What the model has to say of itself on its page, as HTML."""
    path = model / "notes.html"
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def _reference(
    model: Path, table: Table, files: dict[str, bytes], fmi: int, target: str
) -> dict[str, bytes]:
    """The reference experiment's files, if the model has one, with a note in the documentation."""
    path, identifier = model / "reference.toml", table.model["identifier"]
    if not path.is_file():
        return {}
    experiment = reference.read_experiment(path, table)
    note = {"documentation/fmi-ls-ref.txt": reference.notes(experiment, identifier)}
    if table.model["needs"]:  # who puts it in adds the result
        return note | reference.reference_files(experiment, identifier, [])
    if target != target_platform():
        return note
    rows = reference.result(experiment, files, fmi)
    return note | reference.reference_files(experiment, identifier, rows)


def write_zip(path: Path, files: dict[str, bytes]) -> None:
    """A zip with fixed time stamps and sorted entries, put in place in one move."""
    part = path.with_suffix(".part")
    with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, ZIP_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3  # Unix, wherever this runs
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, files[name])
    part.replace(path)
