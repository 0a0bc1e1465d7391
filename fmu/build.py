"""Builds the FMUs of a model: ``python fmu/build.py [--model vehicle] [--out cosim/fmus]``.

A model is a folder with ``variables.toml`` and C files; ``fmu/common`` holds the FMI ceremony. Both
FMI versions are compiled from the same sources and zipped with their descriptions. The same input
gives the same bytes.
"""

import argparse
import hashlib
import importlib.util
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat
from pathlib import Path

import describe
import generate
import states
from variables import Table, TableError, read_table

FMU_DIRECTORY = Path(__file__).resolve().parent
COMMON = FMU_DIRECTORY / "common"
VERSIONS = (2, 3)  # of FMI
# -ffp-contract=off: the same results on processors with and without fused multiply-add
# -Wno-psabi: vectors of four go to inlined functions only, where no calling convention applies
PORTABLE = [
    *["-std=c11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"],
    "-Wno-psabi",
]
FLAGS = [*PORTABLE, "-fPIC", "-fvisibility=hidden", "-Wall", "-Wextra", "-Werror"]
SANITIZE = [
    *["-std=c11", "-O1", "-g", "-ffp-contract=off", "-fno-omit-frame-pointer", "-Wall", "-Wextra"],
    *["-Werror", "-Wno-psabi", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"],
]
ROAD_READER = "road_crg.so"
ZIP_TIME = (1980, 1, 1, 0, 0, 0)
NO_COMPILER = (
    "No C compiler was found: install one (Debian and Ubuntu: 'apt install gcc libc6-dev',"
    " Fedora: 'dnf install gcc', macOS: 'xcode-select --install')"
    " or name yours in the environment variable CC."
)


class BuildError(Exception):
    """A sentence for the user; the build ends with exit code 2."""


def compiler(name: str | None) -> list[str]:
    """The compiler's command: the given one, $CC, or the first of cc, gcc and clang."""
    wanted = name or os.environ.get("CC")
    if wanted:
        command = shlex.split(wanted)
        if not shutil.which(command[0]):
            raise BuildError(f"The C compiler '{command[0]}' was not found. {NO_COMPILER}")
        return command
    for candidate in ("cc", "gcc", "clang"):
        if shutil.which(candidate):
            return [candidate]
    raise BuildError(NO_COMPILER)


def target_platform() -> str:
    """The FMI 3 platform of this machine, such as x86_64-linux."""
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower())
    system = {"darwin": "darwin", "win32": "windows"}.get(sys.platform, "linux")
    return f"{machine or platform.machine().lower()}-{system}"


def binary_path(identifier: str, fmi: int, target: str) -> str:
    """Where an FMU keeps its shared object: FMI 2 knows only system and word size."""
    system = target.partition("-")[2]
    suffix = {"darwin": ".dylib", "windows": ".dll"}.get(system, ".so")
    fmi2_name = {"darwin": "darwin64", "windows": "win64"}.get(system, "linux64")
    return f"binaries/{fmi2_name if fmi == 2 else target}/{identifier}{suffix}"


def header_directory() -> Path:
    """The FMI headers that come with FMPy."""
    package = importlib.util.find_spec("fmpy")
    if package is None or not package.submodule_search_locations:
        raise BuildError(
            "The FMI headers come with FMPy, which is not installed: 'pip install fmpy'."
        )
    return Path(package.submodule_search_locations[0]) / "c-code"


def project_version() -> str:
    """Version of the project, from pyproject.toml."""
    project = FMU_DIRECTORY.parent / "pyproject.toml"
    if not project.is_file():
        return "0"
    return str(tomllib.loads(project.read_text(encoding="utf-8"))["project"].get("version", "0"))


def source_files(model: Path, fmi: int) -> dict[str, bytes]:
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
    for name, content in sorted({**source_files(model, 2), **source_files(model, 3)}.items()):
        digest.update(name.encode() + b"\0" + content)
    h = digest.hexdigest()
    return f"{{{h[:8]}-{h[8:12]}-{h[12:16]}-{h[16:20]}-{h[20:32]}}}"


def all_sources(model: Path, table: Table, fmi: int) -> dict[str, bytes]:
    """Everything a compiler needs for one FMI version, by file name."""
    headers = header_directory()
    files = source_files(model, fmi)
    files["variables.h"] = generate.header(table).encode()
    files["variables.c"] = generate.source(table, instantiation_token(model)).encode()
    for path in sorted(headers.glob(f"fmi{fmi}*.h")):
        files[path.name] = path.read_bytes()
    return files


def c_files(sources: dict[str, bytes]) -> list[str]:
    """The names to compile, sorted."""
    return sorted(name for name in sources if name.endswith(".c"))


def run_compiler(command: list[str], folder: Path) -> None:
    """One call of the compiler; its messages become a BuildError if it fails."""
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise BuildError(f"{result.stderr.strip()}\nThe compiler failed: {shlex.join(command)}")


def link_time_optimisation(cc: list[str]) -> list[str]:
    """The option for it, if this compiler and its linker can: small functions of different files
    become one, which makes the plant a quarter faster.
    """
    with tempfile.TemporaryDirectory() as name:
        Path(name, "probe.c").write_text("int probe(void) { return 0; }\n", encoding="utf-8")
        command = [*cc, "-flto=auto", "-fPIC", "-shared", "probe.c", "-o", "probe"]
        result = subprocess.run(command, cwd=name, capture_output=True, check=False)
    return ["-flto=auto"] if result.returncode == 0 and not result.stderr else []


def belongs(name: str, fmi: int) -> bool:
    """Whether a C file is for this FMI version: fmi2.c is for 2 only, most are for both."""
    only = re.fullmatch(r"(?:fmi|smoke)(\d)\.c", name)
    return only is None or only[1] == str(fmi)


def link(
    cc: list[str], flags: list[str], sources: dict[str, bytes], last: list[str]
) -> dict[int, bytes]:
    """Compile each file once, link once for each FMI version; returns the bytes of both results.

    A fresh folder with bare names, so that no path of this machine enters the binary.
    """
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(os.cpu_count()) as pool:
        folder = Path(name)
        for file, content in sources.items():
            (folder / file).write_bytes(content)
        compile_one = [[*cc, *flags, "-c", file, "-o", f"{file}.o"] for file in c_files(sources)]
        list(pool.map(run_compiler, compile_one, repeat(folder)))
        results = {}
        for fmi in VERSIONS:
            objects = [f"{file}.o" for file in c_files(sources) if belongs(file, fmi)]
            run_compiler([*cc, *flags, *objects, *last, "-lm", "-o", "linked"], folder)
            results[fmi] = (folder / "linked").read_bytes()
        return results


def folder_files(folder: Path, prefix: str) -> dict[str, bytes]:
    """All files below a folder, if it exists, by their path in the FMU."""
    return {
        f"{prefix}/{path.relative_to(folder).as_posix()}": path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def fmu_contents(model: Path, fmi: int, binary: bytes, target: str) -> dict[str, bytes]:
    """Every file of an FMU by its path."""
    table = read_table(model / "variables.toml")
    token, version = instantiation_token(model), project_version()
    sources = all_sources(model, table, fmi)
    files = {f"sources/{name}": content for name, content in sources.items()}
    files[binary_path(table.model["identifier"], fmi, target)] = binary
    files["documentation/index.html"] = describe.documentation(table, version)
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
        files["documentation/licenses/license.txt"] = licence.read_bytes()
    if fmi == 2:
        files["modelDescription.xml"] = describe.fmi2(table, version, token, c_files(sources))
        return files
    files["modelDescription.xml"] = describe.fmi3(table, version, token)
    files["sources/buildDescription.xml"] = describe.build_description(
        table, c_files(sources), " ".join(PORTABLE)
    )
    if table.terminals:
        files["terminalsAndIcons/terminalsAndIcons.xml"] = describe.terminals(table)
    return files


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


def build(
    model: Path, out: Path, cc: str | None = None, cflags: str = "", target: str | None = None
) -> list[Path]:
    """Build both FMUs of a model; returns their paths. Raises BuildError or TableError."""
    table = read_table(model / "variables.toml")
    platform_name = target or target_platform()
    shared = "-dynamiclib" if platform_name.endswith("darwin") else "-shared"
    sources = {**all_sources(model, table, 2), **all_sources(model, table, 3)}
    command = compiler(cc)
    flags = [*FLAGS, *link_time_optimisation(command), *shlex.split(cflags)]
    binaries = link(command, flags, sources, [shared])
    out.mkdir(parents=True, exist_ok=True)
    paths = []
    for fmi, binary in binaries.items():
        path = out / f"{table.model['identifier']}.fmi{fmi}.fmu"
        write_zip(path, fmu_contents(model, fmi, binary, platform_name))
        paths.append(path)
    return paths


def build_road_reader(out: Path, cc: str | None = None, cflags: str = "") -> Path:
    """The vehicle's OpenCRG reader as a shared library of its own, so that the driver reads a
    user's road with the very code that the wheels run on; returns its path. Raises BuildError.
    """
    model = FMU_DIRECTORY / "vehicle"
    files = [model / "four.h", *sorted(model.glob("road_crg*.[ch]"))]
    sources = {path.name: path.read_bytes() for path in files}
    flags = [flag for flag in FLAGS if flag != "-fvisibility=hidden"]
    command = [*compiler(cc), *flags, *shlex.split(cflags), "-shared", *c_files(sources)]
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        for file, content in sources.items():
            Path(name, file).write_bytes(content)
        run_compiler([*command, "-lm", "-o", ROAD_READER], Path(name))
        part = out / f".{ROAD_READER}.part"
        part.write_bytes(Path(name, ROAD_READER).read_bytes())
    return part.replace(out / ROAD_READER)


def smoke_programs(model: Path, out: Path, cc: str | None, flags: list[str]) -> list[Path]:
    """Programs of ``smoke.c`` and the model, for FMI 2 and 3."""
    table = read_table(model / "variables.toml")
    sources = {**all_sources(model, table, 2), **all_sources(model, table, 3)}
    smoke = (FMU_DIRECTORY / "smoke.c").read_bytes()
    for fmi in VERSIONS:
        sources[f"smoke{fmi}.c"] = f'#define SMOKE_FMI {fmi}\n#line 1 "smoke.c"\n'.encode() + smoke
    out.mkdir(parents=True, exist_ok=True)
    programs = []
    for fmi, content in link(compiler(cc), flags, sources, []).items():
        program = out / f"{table.model['identifier']}.fmi{fmi}.smoke"
        program.write_bytes(content)
        program.chmod(0o755)
        programs.append(program)
    return programs


def sanitize(model: Path, out: Path, cc: str | None = None, cflags: str = "") -> list[Path]:
    """The smoke programs with the address and undefined-behaviour sanitizers."""
    return smoke_programs(model, out, cc, [*SANITIZE, *shlex.split(cflags)])


def model_folder(name: str) -> Path:
    """A model by name (a folder of fmu/) or by path."""
    for candidate in (FMU_DIRECTORY / name, Path(name)):
        if (candidate / "variables.toml").is_file():
            return candidate.resolve()
    known = sorted(path.parent.name for path in FMU_DIRECTORY.glob("*/variables.toml"))
    raise BuildError(
        f"There is no model '{name}'; the models here are {', '.join(known) or 'none'}."
    )


def arguments(argv: list[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description="Build the FMUs (FMI 2.0 and 3.0) of a model.")
    parser.add_argument("--model", default="vehicle", help="folder of fmu/, or a path")
    parser.add_argument("--out", type=Path, default=FMU_DIRECTORY.parent / "cosim" / "fmus")
    parser.add_argument("--cc", help="C compiler; default $CC, cc, gcc or clang")
    parser.add_argument("--cflags", default="", help="more compiler options")
    parser.add_argument("--platform", help="FMI 3 platform a cross compiler builds for")
    parser.add_argument(
        "--sanitize", action="store_true", help="build and run the smoke test instead"
    )
    parser.add_argument("settings", nargs="*", help="with --sanitize: Name=value, start values")
    return parser.parse_args(argv)


def main(argv: list[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = arguments(argv)
    try:
        model = model_folder(options.model)
        if not options.sanitize:
            for path in build(model, options.out, options.cc, options.cflags, options.platform):
                print(path)
            if model.name == "vehicle":
                print(build_road_reader(options.out, options.cc, options.cflags))
            return 0
        with tempfile.TemporaryDirectory() as folder:
            programs = sanitize(model, Path(folder), options.cc, options.cflags)
            commands = [[str(program), *options.settings] for program in programs]
            return max(subprocess.run(c, check=False).returncode != 0 for c in commands)
    except (BuildError, TableError) as error:
        print(error, file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
