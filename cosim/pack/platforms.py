"""Binaries of the sensor FMU for other platforms: `make cross` compiles them into the cache."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from cosim.cache import default_cache_dir
from cosim.check.binaries import here
from cosim.errors import InputError, Problem, did_you_mean
from cosim.pack.template import IDENTIFIER, Template

PLATFORMS: Final = (
    "x86_64-linux", "aarch64-linux", "x86_64-windows", "x86_64-darwin", "aarch64-darwin",
)  # fmt: skip
ALL: Final = "all"
FMI2_PLATFORMS: Final = ("x86_64-linux", "x86_64-windows", "x86_64-darwin")  # FMI 2 has no others


def cross_cache(token: str, platform: str) -> Path:
    """Return the folder in which the FMUs of one build, known by its token, and platform lie."""
    return default_cache_dir() / "cross" / token.strip("{}") / platform


def binaries(template: Template, platforms: Sequence[str]) -> dict[str, bytes]:
    """Return the binaries of these platforms beside this machine's, by their path in the FMU.

    "all" stands for every platform that the template's FMI version knows. Raises `InputError` for
    an unknown platform, and where a binary has not been compiled.
    """
    known = FMI2_PLATFORMS if template.fmi == 2 else PLATFORMS
    wanted = [name for p in platforms for name in (known if p == ALL else (p,))]
    own = "-".join(here())
    problems: list[Problem] = []
    files: dict[str, bytes] = {}
    missing = []
    for platform in dict.fromkeys(wanted):
        if platform not in known:
            problems.append(Problem(_unknown(platform, template.fmi, known)))
        elif platform != own:
            found = _cached(template, platform)
            files |= found
            missing += [platform] if not found else []
    if missing:
        problems.append(Problem(_not_compiled(template, missing)))
    if problems:
        raise InputError(problems)
    return files


def _cached(template: Template, platform: str) -> dict[str, bytes]:
    path = cross_cache(template.token, platform) / f"{IDENTIFIER}.fmi{template.fmi}.fmu"
    if not path.is_file():
        return {}
    with zipfile.ZipFile(path) as archive:
        return {n: archive.read(n) for n in archive.namelist() if n.startswith("binaries/")}


def _unknown(platform: str, fmi: int, known: Sequence[str]) -> str:
    if platform in PLATFORMS:
        return f"FMI {fmi}.0 has no name for platform '{platform}'; pack for FMI 3 (--fmi 3)"
    choices = [*known, ALL]
    return (
        f"there is no platform '{platform}' among {', '.join(known)} and {ALL}"
        f"{did_you_mean(platform, choices)}"
    )


def _not_compiled(template: Template, missing: Sequence[str]) -> str:
    where = cross_cache(template.token, missing[0]).parent
    return (
        f"no binary for {', '.join(missing)} in {where}: run 'make cross' in the project's folder, "
        "which installs the extra 'cross' (ziglang)"
    )
