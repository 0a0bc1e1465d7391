"""FMUs rebuilt from the sources that they carry, with a change: compiled without optimisation, the
untouched files once.
"""

from __future__ import annotations

import shlex
import subprocess
import zipfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from fmu_face import build
from fmu_mutants import mutate, patched

Changes = Sequence[tuple[str, str, str]]  # file, pattern, text instead
FLAGS = ("-std=gnu11", "-O0", "-fPIC", "-fvisibility=hidden", "-w")


@cache
def sources(fmu: Path) -> dict[str, bytes]:
    """Return the sources of an FMU by name."""
    with zipfile.ZipFile(fmu) as archive:
        names = [n for n in archive.namelist() if n.startswith("sources/") and "." in n]
        return {name.removeprefix("sources/"): archive.read(name) for name in names}


@cache
def objects(fmu: Path) -> dict[str, Path]:
    """Return the compiled sources of an FMU as they are."""
    folder = Path(mkdtemp(prefix="fmu-objects-"))
    for name, content in sources(fmu).items():
        (folder / name).write_bytes(content)
    return {name: compiled(folder, name) for name in sources(fmu) if name.endswith(".c")}


def compiled(folder: Path, name: str) -> Path:
    """Compile one file; its object lies beside it."""
    target = folder / f"{name}.o"
    run([*build.compiler(None), *FLAGS, "-c", name, "-o", target.name], folder)
    return target


def run(command: list[str], folder: Path) -> None:
    """Run a compiler; its words are the failure's."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{shlex.join(command)}\n{done.stderr}"


def rebuilt(fmu: Path, folder: Path, changes: Changes, **others: object) -> Path:
    """Write the FMU with changed sources as `folder`/mutant.fmu; `others` as for `mutate`."""
    changed = patched(sources(fmu), changes)
    for name, content in changed.items():
        (folder / name).write_bytes(content)
    touched = {name for name, _, _ in changes}
    parts = [name if name in touched else str(path) for name, path in objects(fmu).items()]
    run([*build.compiler(None), *FLAGS, "-shared", *parts, "-lm", "-o", "linked.so"], folder)
    with zipfile.ZipFile(fmu) as archive:
        binary = next(n for n in archive.namelist() if n.startswith("binaries/"))
    content = (folder / "linked.so").read_bytes()
    return mutate(fmu, folder / "mutant.fmu", files={binary: content}, **others)
