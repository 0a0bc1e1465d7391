"""Reading shared libraries of three systems, and what the checker says of an FMU's binaries."""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest
from fmu_face import build, package
from fmu_mutants import mutate

from cosim.check.binaries import here, meaning
from cosim.check.checker import check
from cosim.check.finding import Report
from cosim.check.shared_library import LibraryError, read_library
from cosim.check.symbols import required, standard_functions

LINUX_ONLY = pytest.mark.skipif(sys.platform != "linux", reason="compiles ELF libraries")
PLACE = {v: package.binary_path("lag", v, build.target_platform()) for v in (2, 3)}
LOGGING = Path(fmpy.__file__).parent / "logging"


@pytest.fixture
def with_binary(
    fmus: dict[int, Path], version: int, tmp_path: Path
) -> Callable[[bytes | None], Report]:
    def make(binary: bytes | None) -> Report:
        path = mutate(fmus[version], tmp_path / "m.fmu", files={PLACE[version]: binary})
        return check(path, static=True)

    return make


def own(fmus: dict[int, Path], version: int) -> bytes:
    with zipfile.ZipFile(fmus[version]) as archive:
        return archive.read(PLACE[version])


def compiled(folder: Path, text: str, *flags: str) -> bytes:
    (folder / "code.c").write_text(text)
    command = [*build.compiler(None), "-fPIC", *flags, "code.c", "-o", "code.out"]
    build.run_compiler(command, folder)
    return (folder / "code.out").read_bytes()


def stubs(names: list[str]) -> str:
    return "".join(f"int {name}(void) {{ return 0; }}\n" for name in names)


@pytest.mark.skipif(not shutil.which("nm"), reason="needs nm")
@LINUX_ONLY
def test_elf_exports_are_those_that_nm_sees(fmus: dict[int, Path], version: int, tmp_path: Path):
    file = tmp_path / "lag.so"
    file.write_bytes(own(fmus, version))
    command = ["nm", "-D", "--defined-only", str(file)]
    listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    library = read_library(file.read_bytes())
    assert library.exports == {line.split()[-1] for line in listing.splitlines()}
    assert library.system == "linux"
    assert here()[0] in library.machines


@pytest.mark.parametrize(
    ("file", "system", "machine"),
    [
        ("win64/logging.dll", "windows", "x86_64"),
        ("win32/logging.dll", "windows", "x86"),
        ("linux64/logging.so", "linux", "x86_64"),
        ("darwin64/logging.dylib", "darwin", "x86_64"),
    ],
)
def test_libraries_that_others_compiled(file: str, system: str, machine: str) -> None:
    """FMPy brings one library for four platforms; its source exports addLoggerProxy."""
    library = read_library((LOGGING / file).read_bytes())
    assert library.system == system
    assert machine in library.machines
    assert library.exports is not None
    assert "addLoggerProxy" in library.exports


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"hello there", "68 65 6c 6c"),
        (b"<!DOCTYPE html>", "text file"),
        (b"version https://git-lfs.github.com/spec/v1\n", "Git LFS pointer"),
        (b"!<arch>\nlag.o/", "static library"),
        (b"\x7fELF\x02\x01\x01", "cut short"),
        (b"MZ" + b"\0" * 20, "cut short"),
    ],
)
def test_what_is_no_library(content: bytes, words: str) -> None:
    with pytest.raises(LibraryError, match=words):
        read_library(content)


@pytest.mark.parametrize(
    "file",
    ["win64/logging.dll", "win32/logging.dll", "linux64/logging.so", "darwin64/logging.dylib"],
)
def test_libraries_cut_anywhere_never_crash_the_reader(file: str) -> None:
    content = (LOGGING / file).read_bytes()
    cut = 0
    for size in range(0, len(content), max(len(content) // 97, 1)):
        try:
            read_library(content[:size])
        except LibraryError:
            cut += 1
    assert cut > 40


def codes(report: Report) -> list[tuple[str, str]]:
    return [(f.code, f.message) for f in report.findings]


def test_garbage_and_a_truncated_binary(
    with_binary: Callable[[bytes | None], Report], fmus: dict[int, Path], version: int
) -> None:
    ((code, message),) = codes(with_binary(b"\0\1garbage"))
    assert code == "binary-format"
    assert PLACE[version] in message
    ((code, message),) = codes(with_binary(own(fmus, version)[:20_000]))
    assert code == "binary-format"
    assert "cut short" in message


def test_a_binary_for_another_machine(
    with_binary: Callable[[bytes | None], Report], fmus: dict[int, Path], version: int
) -> None:
    binary = bytearray(own(fmus, version))
    struct.pack_into("<H", binary, 18, 183)  # e_machine of AArch64
    ((code, message),) = codes(with_binary(bytes(binary)))
    assert code == "binary-architecture"
    assert "aarch64 linux" in message
    assert "x86_64 linux" in message
    ((code, message),) = codes(with_binary((LOGGING / "win64" / "logging.dll").read_bytes()))
    assert code == "binary-architecture"
    assert "x86_64 windows" in message


@LINUX_ONLY
def test_a_program_is_no_library(
    with_binary: Callable[[bytes | None], Report], tmp_path: Path
) -> None:
    ((code, message),) = codes(with_binary(compiled(tmp_path, "int x;", "-c")))
    assert code == "binary-format"
    assert "an object file" in message


@LINUX_ONLY
def test_each_missing_function_is_named_with_what_needs_it(
    with_binary: Callable[[bytes | None], Report], version: int, tmp_path: Path
) -> None:
    state = "fmi2SetFMUstate" if version == 2 else "fmi3SetFMUState"
    derivative = f"fmi{version}GetDirectionalDerivative"
    missing = {state, derivative, f"fmi{version}DoStep"}
    names = [name for name in standard_functions(version) if name not in missing]
    report = with_binary(compiled(tmp_path, stubs(names), "-shared"))
    assert report.codes == ["symbol-missing"]
    said = {next(n for n in missing if n in f.message): f.message for f in report.findings}
    assert set(said) == missing
    flag = "canGetAndSetFMUstate" if version == 2 else "canGetAndSetFMUState"
    assert f'{flag}="true" promises it' in said[state]
    assert "even where the FMU does not use it" in said[derivative]
    assert f"FMI {version}.0 wants it" in said[f"fmi{version}DoStep"]


@LINUX_ONLY
def test_functions_with_the_prefix_of_static_linking(
    with_binary: Callable[[bytes | None], Report], version: int, tmp_path: Path
) -> None:
    names = [f"lag_{name}" for name in standard_functions(version)]
    report = with_binary(compiled(tmp_path, stubs(names), "-shared"))
    assert report.codes == ["symbol-missing", "symbol-extra"]
    assert "compiled for static linking" in report.findings[0].message


@LINUX_ONLY
def test_extra_symbols_are_a_warning(
    with_binary: Callable[[bytes | None], Report], version: int, tmp_path: Path
) -> None:
    names = [*standard_functions(version), "helper", "_ZN3lag3runEv", "_init_array_of_mine"]
    report = with_binary(compiled(tmp_path, stubs(names), "-shared"))
    assert report.codes == ["symbol-extra"]
    assert "2 symbols beyond" in report.findings[0].message
    assert "helper" in report.findings[0].message
    assert report.exit_code == 0


@LINUX_ONLY
def test_fmi3_functions_of_other_interfaces_are_a_warning(
    fmus: dict[int, Path], tmp_path: Path
) -> None:
    binary = compiled(tmp_path, stubs(list(required(3))), "-shared")
    report = check(mutate(fmus[3], tmp_path / "m.fmu", files={PLACE[3]: binary}), static=True)
    assert report.codes == ["symbol-other-interface"]
    assert "fmi3InstantiateModelExchange" in report.findings[0].message or "more" in str(report)


def test_an_fmu_without_a_binary_for_this_machine(
    fmus: dict[int, Path], version: int, tmp_path: Path
) -> None:
    other = {2: "binaries/win64/lag.dll", 3: "binaries/ppc64-linux/lag.so"}[version]
    path = mutate(fmus[version], tmp_path / "m.fmu", renamed={PLACE[version]: other})
    report = check(path)
    found = [f for f in report.findings if f.code == "no-binary-here"]
    assert other.split("/")[1] in found[0].message
    assert "-".join(here()) in found[0].message
    bare = mutate(fmus[version], tmp_path / "b.fmu", files={PLACE[version]: None})
    (finding,) = check(bare).findings
    assert finding.code == "no-binary-here"
    assert "none at all; its sources could be compiled" in finding.message
    assert check(bare, static=True).findings == []


@pytest.mark.parametrize(
    ("folder", "expected"),
    [
        ("linux64", ("x86_64", "linux")), ("win32", ("x86", "windows")),
        ("darwin64", ("", "darwin")), ("aarch64-darwin", ("aarch64", "darwin")),
        ("x86_64-windows", ("x86_64", "windows")), ("riscv64-linux", ("riscv64", "linux")),
        ("x86_64-linux-musl", ("x86_64", "linux")), ("amiga", None), ("linux", None),
    ],
)  # fmt: skip
def test_platform_folders(folder: str, expected: tuple[str, str] | None) -> None:
    assert meaning(folder) == expected
