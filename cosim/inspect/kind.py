"""What a file is, by its content; and in a sentence what it looks like if it is none of ours."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Final, Literal

from cosim.errors import InputError, nearest

Kind = Literal["fmu", "network", "scenario", "road"]
ENDINGS: Final = {".fmu": "fmu", ".onnx": "network", ".yaml": "scenario", ".yml": "scenario",
                  ".crg": "road"}  # fmt: skip
WANTED: Final = "an FMU, an ONNX network, a scenario (YAML) or an OpenCRG road"
_MAGIC: Final = {
    b"PAR1": "a Parquet file", b"\x89PNG": "a PNG picture", b"%PDF": "a PDF document",
    b"\x89HDF": "an HDF5 file", b"MATLAB": "a MATLAB file", b"\x7fELF": "a program or library",
    b"MZ": "a Windows program or library", b"\x1f\x8b": "a gzip archive", b"Rar!": "a RAR archive",
    b"7z\xbc\xaf": "a 7-Zip archive", b"\x93NUMPY": "a NumPy array",
    b"SQLite": "an SQLite database", b"BZh": "a bzip2 archive",
}  # fmt: skip
_ONNX_STARTS: Final = (b"\x08", b"\x12", b"\x3a")  # fields that a ModelProto begins with


def recognise(path: Path) -> Kind:
    """Return what a file is. Raises `InputError` with what it looks like instead, and the nearest
    file that can be inspected.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file{_hint(path)}")
    if path.is_dir():
        what = "the folder of an unpacked FMU; zip its content first" if (
            path / "modelDescription.xml"
        ).is_file() else f"a folder, not {WANTED}"  # fmt: skip
        raise InputError(f"{path} is {what}{_inside(path)}")
    with path.open("rb") as file:
        head = file.read(1 << 16)
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        return _zip(path)
    looks = next((words for magic, words in _MAGIC.items() if head.startswith(magic)), "")
    if looks:
        raise _other(path, looks)
    if _is_road(head):
        return "road"
    if path.suffix.lower() == ".onnx":
        return "network"
    text = _text(head)
    if text is None:
        if head.startswith(_ONNX_STARTS):
            return "network"
        raise _other(path, "binary data")
    if path.suffix.lower() in (".yaml", ".yml"):
        return _yaml(path, text)
    raise _other(path, _written(path, text))


def _is_road(head: bytes) -> bool:
    folded = head.upper()
    return b"$ROAD_CRG" in folded or (folded.lstrip().startswith(b"$CT") and b"$KD_" in folded)


def _text(head: bytes) -> str | None:
    if b"\0" in head:
        return None
    try:
        return head.decode("utf-8")
    except UnicodeDecodeError as error:
        whole = error.start >= len(head) - 4 and len(head) == 1 << 16  # a letter cut in two
        return head[: error.start].decode("utf-8") if whole else None


def _zip(path: Path) -> Kind:
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except (zipfile.BadZipFile, OSError) as error:
        raise InputError(f"{path}: a ZIP archive that is cut short or damaged: {error}") from None
    if any(name.rsplit("/", 1)[-1].casefold() == "modeldescription.xml" for name in names):
        return "fmu"
    if "SystemStructure.ssd" in names:
        raise _other(path, "a system of FMUs (SSP); unzip it and inspect the FMUs in resources/")
    office = "[Content_Types].xml" in names
    what = "an Office document" if office else "a ZIP archive without modelDescription.xml"
    what = "arrays of NumPy" if path.suffix.lower() == ".npz" else what
    raise _other(path, what)


def _yaml(path: Path, text: str) -> Kind:
    keys = {line.split(":")[0] for line in text.splitlines() if line[:1].isalpha()}
    if "road" in keys or "controllers" in keys or "driver" in keys:
        return "scenario"
    if "runs" in keys and "training" in keys:
        raise _other(path, "a training recipe (cosim sensor train)")
    if "runs" in keys:
        raise _other(path, "a recipe of a data set (cosim sensor dataset)")
    if keys & {"loads", "parameters", "scales"} and "name" in keys:
        raise _other(path, "a variant of the vehicle (vehicle.variants of a scenario)")
    return "scenario"  # whose messages say what is missing


def _written(path: Path, text: str) -> str:
    stripped = text.lstrip("\ufeff \t\r\n")
    if not stripped:
        return "an empty file"
    if "<fmiModelDescription" in text:
        return "the model description of an FMU; inspect the FMU itself"
    if stripped.startswith("<"):
        return "XML or HTML"
    names = {".py": "a Python program", ".c": "a C program", ".md": "a text", ".json": "JSON",
             ".toml": "a TOML file", ".csv": "a table of numbers (CSV)",
             ".tsv": "a table of numbers (TSV)"}  # fmt: skip
    return names.get(path.suffix.lower(), "JSON" if stripped[0] in "{[" else "a text")


def _other(path: Path, looks: str) -> InputError:
    same = [n for n in _candidates(path.parent) if Path(n).stem == path.stem and n != path.name]
    hint = _question(path.parent / same[0]) if same else ""
    what, _, advice = looks.partition("; ")
    then = f"; {advice}" if advice else ""
    return InputError(f"{path} looks like {what}, not {WANTED}{then}{hint}")


def _candidates(folder: Path) -> list[str]:
    if not folder.is_dir():
        return []
    return sorted(f.name for f in folder.iterdir() if f.suffix.lower() in ENDINGS and f.is_file())


def _hint(path: Path) -> str:
    """Return the file nearest to a missing one, in a question."""
    beside = _candidates(path.parent)
    match = nearest(path.name, beside) or nearest(path.stem, beside)
    return _question(path.parent / match) if match else ""


def _inside(folder: Path) -> str:
    inside = _candidates(folder)
    return _question(folder / inside[0]) if inside else ""


def _question(path: Path) -> str:
    return f"; did you mean '{path}'?"
