"""Builds the FMUs of all models: ``python fmu/build.py [--model vehicle] [--out cosim/fmus]``.

A model is a folder with ``variables.toml`` and C files; ``fmu/common`` holds the FMI ceremony. Both
FMI versions are compiled from the same sources and zipped with their descriptions. The same input
gives the same bytes.
"""

import argparse
import shlex
import sys
import tempfile
from pathlib import Path

from package import FMU_DIRECTORY, compiled_sources, fmu_contents, write_zip
from toolchain import (
    FLAGS,
    VERSIONS,
    BuildError,
    c_files,
    compiler,
    link,
    link_time_optimisation,
    run_compiler,
    target_platform,
)
from variables import TableError, read_table

ROAD_READER = "road_crg.so"
PROGRAMS = ("smoke", "fuzz")  # that test a model from C


def build(
    model: Path, out: Path, cc: str | None = None, cflags: str = "", target: str | None = None
) -> list[Path]:
    """Build both FMUs of a model; returns their paths. Raises BuildError or TableError."""
    table = read_table(model / "variables.toml")
    platform_name = target or target_platform()
    shared = "-dynamiclib" if platform_name.endswith("darwin") else "-shared"
    command = compiler(cc)
    flags = [*FLAGS, *link_time_optimisation(command), *shlex.split(cflags)]
    binaries = link(command, flags, compiled_sources(model, table), [shared])
    out.mkdir(parents=True, exist_ok=True)
    paths = []
    for (_, fmi), binary in binaries.items():
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


def trial_programs(
    model: Path, out: Path, cc: str | None, flags: list[str], names: tuple[str, ...] = PROGRAMS
) -> dict[tuple[str, int], Path]:
    """Programs of ``smoke.c`` and ``fuzz.c`` with the model, by name and FMI version."""
    table = read_table(model / "variables.toml")
    sources = compiled_sources(model, table)
    sources |= {path.name: path.read_bytes() for path in FMU_DIRECTORY.glob("*.h")}
    for name in names:
        text = (FMU_DIRECTORY / f"{name}.c").read_bytes()
        for fmi in VERSIONS:
            head = f'#define FACE_FMI {fmi}\n#line 1 "{name}.c"\n'
            sources[f"{name}{fmi}.c"] = head.encode() + text
    out.mkdir(parents=True, exist_ok=True)
    paths = {}
    for (name, fmi), content in link(compiler(cc), flags, sources, [], names).items():
        path = out / f"{table.model['identifier']}.fmi{fmi}.{name}"
        path.write_bytes(content)
        path.chmod(0o755)
        paths[name, fmi] = path
    return paths


def model_folders(name: str | None) -> list[Path]:
    """A model by name (a folder of fmu/) or by path; all of them without one."""
    known = sorted(path.parent for path in FMU_DIRECTORY.glob("*/variables.toml"))
    if name is None:
        return known
    for candidate in (FMU_DIRECTORY / name, Path(name)):
        if (candidate / "variables.toml").is_file():
            return [candidate.resolve()]
    names = ", ".join(path.name for path in known)
    raise BuildError(f"There is no model '{name}'; the models here are {names or 'none'}.")


def arguments(argv: list[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description="Build the FMUs (FMI 2.0 and 3.0) of a model.")
    parser.add_argument("--model", help="folder of fmu/, or a path; all of fmu/ by default")
    parser.add_argument("--out", type=Path, default=FMU_DIRECTORY.parent / "cosim" / "fmus")
    parser.add_argument("--cc", help="C compiler; default $CC, cc, gcc or clang")
    parser.add_argument("--cflags", default="", help="more compiler options")
    parser.add_argument("--platform", help="FMI 3 platform a cross compiler builds for")
    return parser.parse_args(argv)


def main(argv: list[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = arguments(argv)
    try:
        for model in model_folders(options.model):
            for path in build(model, options.out, options.cc, options.cflags, options.platform):
                print(path)
            if model.name == "vehicle":
                print(build_road_reader(options.out, options.cc, options.cflags))
        return 0
    except (BuildError, TableError) as error:
        print(error, file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
