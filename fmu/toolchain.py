"""The C compiler: finding it, its options, compiling and linking the sources of an FMU."""

import importlib.util
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat
from pathlib import Path

VERSIONS = (2, 3)  # of FMI
# -ffp-contract=off: the same results on processors with and without fused multiply-add
# -Wno-psabi: vectors of four go to inlined functions only, where no calling convention applies
PORTABLE = ["-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-Wno-psabi"]
FLAGS = ["-std=c11", *PORTABLE, "-fPIC", "-fvisibility=hidden", "-Wall", "-Wextra", "-Werror"]
SANITIZE = [  # -O0: with sanitizers the optimiser takes half a minute over the vectors
    *["-std=c11", "-O0", "-g", "-ffp-contract=off", "-fno-omit-frame-pointer", "-Wall", "-Wextra"],
    *["-Werror", "-Wno-psabi", "-fsanitize=address,undefined,float-cast-overflow"],
    "-fno-sanitize-recover=all",
]
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


def header_directory() -> Path:
    """The FMI headers that come with FMPy."""
    package = importlib.util.find_spec("fmpy")
    if package is None or not package.submodule_search_locations:
        raise BuildError(
            "The FMI headers come with FMPy, which is not installed: 'pip install fmpy'."
        )
    return Path(package.submodule_search_locations[0]) / "c-code"


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


def belongs(name: str, fmi: int, program: str = "") -> bool:
    """Whether a file is for this FMI version and program: fmi2.c is for 2, most are for all."""
    only = re.fullmatch(r"(fmi|smoke|fuzz)(\d)\.c", name)
    return only is None or (only[1] in ("fmi", program) and only[2] == str(fmi))


def c_files(sources: dict[str, bytes]) -> list[str]:
    """The names to compile, sorted."""
    return sorted(name for name in sources if name.endswith(".c"))


def link(
    cc: list[str],
    flags: list[str],
    sources: dict[str, bytes],
    last: list[str],
    programs: tuple[str, ...] = ("",),
) -> dict[tuple[str, int], bytes]:
    """Compile each file once, link once for each program and FMI version; returns their bytes.

    A fresh folder with bare names, so that no path of this machine enters the binary.
    """
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(os.cpu_count()) as pool:
        folder = Path(name)
        for file, content in sources.items():
            (folder / file).write_bytes(content)
        compile_one = [[*cc, *flags, "-c", file, "-o", f"{file}.o"] for file in c_files(sources)]
        list(pool.map(run_compiler, compile_one, repeat(folder)))
        results = {}
        for program in programs:
            for fmi in VERSIONS:
                objects = [f"{f}.o" for f in c_files(sources) if belongs(f, fmi, program)]
                run_compiler([*cc, *flags, *objects, *last, "-lm", "-o", "linked"], folder)
                results[program, fmi] = (folder / "linked").read_bytes()
        return results
