"""The binaries of an FMU: one for this machine, of the right name and kind, with all functions."""

from __future__ import annotations

import platform
import re
import sys
from collections.abc import Iterator
from typing import Final

from cosim.check.archive import Archive
from cosim.check.description import Description
from cosim.check.finding import Finding, listed, numbered
from cosim.check.shared_library import LibraryError, SharedLibrary, read_library
from cosim.check.symbols import reason, required, standard_functions

SUFFIXES: Final = {"linux": ".so", "windows": ".dll", "darwin": ".dylib"}
FMI2_PLATFORMS: Final = {
    "linux32": ("x86", "linux"), "linux64": ("x86_64", "linux"),
    "win32": ("x86", "windows"), "win64": ("x86_64", "windows"),
    "darwin32": ("x86", "darwin"), "darwin64": ("", "darwin"),  # of either processor
}  # fmt: skip
# what linkers and C++ put into every shared library
_LINKERS: Final = re.compile(
    r"_init|_fini|_edata|_end|__bss_start.*|_mh_\w+_header|_Z.*|__.*|\..*|.*@.*"
)


def here() -> tuple[str, str]:
    """Return processor and system of this machine, in FMI 3's words."""
    machine = platform.machine().lower()
    processor = {"amd64": "x86_64", "arm64": "aarch64", "i686": "x86", "i386": "x86"}
    system = {"darwin": "darwin", "win32": "windows"}.get(sys.platform, "linux")
    return processor.get(machine, machine), system


def meaning(folder: str) -> tuple[str, str] | None:
    """Return processor and system of a folder of binaries/; None for an unknown name."""
    if folder in FMI2_PLATFORMS:
        return FMI2_PLATFORMS[folder]
    match = re.fullmatch(r"([a-z]\w*?)-(linux|windows|darwin)(?:-\w+)?", folder)
    return (match[1], match[2]) if match else None


def platforms(archive: Archive) -> list[str]:
    """Return the folders of binaries/."""
    return sorted({name.split("/")[0] for name in archive.below("binaries") if "/" in name})


def binary_for(archive: Archive, identifier: str, major: int) -> str | None:
    """Return the entry that this machine can load, None if the FMU has none."""
    processor, system = here()
    for folder in platforms(archive):
        kind = meaning(folder)
        fits = kind is not None and kind[1] == system and kind[0] in ("", processor)
        name = f"binaries/{folder}/{identifier}{SUFFIXES[system]}"
        if fits and name in archive and (major == 3 or folder in FMI2_PLATFORMS or "-" in folder):
            return name
    return None


def binary_findings(archive: Archive, description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the binaries of every platform."""
    for folder in platforms(archive):
        yield from _platform(archive, description, folder)


def missing_here(archive: Archive, description: Description) -> Iterator[Finding]:
    """Yield a finding if this machine cannot run the FMU for want of a binary."""
    if binary_for(archive, description.identifier, description.major) is not None:
        return
    processor, system = here()
    there = platforms(archive)
    has_sources = any(name.endswith((".c", ".cpp")) for name in archive.below("sources"))
    others = f"it has {listed(there)}" if there else "it has none at all"
    advice = "; its sources could be compiled" if has_sources else "; ask its maker for one"
    yield Finding(
        "no-binary-here", "binaries/",
        f"no binary for this machine, {processor}-{system}: {others}{advice}",
    )  # fmt: skip


def _platform(archive: Archive, description: Description, folder: str) -> Iterator[Finding]:
    kind = meaning(folder)
    if kind is None:
        lower = meaning(folder.lower())
        code = "wrong-case" if lower else "platform-unknown"
        hint = f"; it must be spelt '{folder.lower()}'" if lower else "; no tool looks there"
        yield Finding(code, f"binaries/{folder}/", f"'{folder}' is no platform of FMI{hint}")
        return
    processor, system = kind
    name = f"binaries/{folder}/{description.identifier}{SUFFIXES[system]}"
    if name not in archive:
        yield from _misnamed(archive, name, folder)
        return
    try:
        library = read_library(archive.read(name))
    except LibraryError as error:
        yield Finding("binary-format", name, f"{name} is no shared library: {error}")
        return
    except Exception:  # an entry that cannot be unpacked is reported with the archive
        return
    if library.system != system or (processor and processor not in library.machines):
        is_ = f"{' and '.join(library.machines)} {library.system}"
        yield Finding(
            "binary-architecture", name,
            f"{name} is a library for {is_}, but its folder is for {processor or 'any'} {system}",
        )  # fmt: skip
    elif library.exports is not None:
        yield from _missing(library, description, name)
        yield from _extra(library, name)


def _misnamed(archive: Archive, name: str, folder: str) -> Iterator[Finding]:
    other = archive.other_case(name)
    if other:
        yield Finding(
            "wrong-case", other,
            f"'{other}' must be spelt '{name}', by the modelIdentifier: names are case-sensitive "
            "on Linux",
        )  # fmt: skip
        return
    there = [f"binaries/{folder}/{file}" for file in archive.below(f"binaries/{folder}")]
    libraries = [file for file in there if file.endswith((".so", ".dll", ".dylib"))]
    static = [file for file in there if file.endswith((".a", ".lib"))]
    if libraries or not static:
        yield Finding(
            "binary-name", f"binaries/{folder}/",
            f"'{name}' is missing: the file is named by the modelIdentifier; the folder holds "
            f"{listed(libraries or there)}",
        )  # fmt: skip


def _missing(library: SharedLibrary, description: Description, name: str) -> Iterator[Finding]:
    exports = library.exports or frozenset()
    wanted = required(description.major)
    missing = [function for function in wanted if function not in exports]
    if len(missing) == len(wanted):
        prefix = next((e for e in sorted(exports) if e.endswith(wanted[0])), None)
        hint = f"; it exports {prefix}, so it was compiled for static linking" if prefix else ""
        yield Finding(
            "symbol-missing", name,
            f"{name} exports no function of FMI {description.version}, not even {wanted[0]}{hint}",
        )  # fmt: skip
        return
    for function in missing:
        yield Finding(
            "symbol-missing", name,
            f"{name} does not export {function}: {reason(function, description)}",
        )  # fmt: skip
    others = set(standard_functions(description.major)) - set(wanted) - exports
    if others and description.major == 3:
        yield Finding(
            "symbol-other-interface", name,
            f"{name} does not export {listed(sorted(others))}: since FMI 3.0.1 the functions of "
            "all interfaces are to be there",
        )  # fmt: skip


def _extra(library: SharedLibrary, name: str) -> Iterator[Finding]:
    every = set(standard_functions(2)) | set(standard_functions(3))
    extra = sorted(
        e for e in (library.exports or ()) if e not in every and not _LINKERS.fullmatch(e)
    )
    if extra:
        yield Finding(
            "symbol-extra", name,
            f"{name} exports {numbered(len(extra), 'symbol')} beyond the standard: "
            f"{listed(extra)}; other libraries may have the same (hide them: -fvisibility=hidden)",
        )  # fmt: skip
