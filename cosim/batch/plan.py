"""From files and folders to jobs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cosim.batch.job import Job
from cosim.errors import InputError, Problem
from cosim.results import RESOLVED


def find_scenarios(paths: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Return the scenario files of `paths`, each once, and the YAML files of folders that are none.

    A folder stands for all *.yaml below it that have a road, as every scenario must; a file that
    cannot be read as YAML counts too, so that its mistake is shown. What a run has left among its
    results does not. Raises `InputError` for a folder without a scenario.
    """
    found: dict[Path, None] = {}
    others: list[Path] = []
    for path in paths:
        if not path.is_dir():
            found[path] = None
            continue
        inside = sorted(file for file in path.rglob("*.yaml") if file.name != RESOLVED)
        scenarios = [file for file in inside if is_scenario(file)]
        if not scenarios:
            raise InputError(f"there is no scenario in the folder '{path}'")
        found.update(dict.fromkeys(scenarios))
        others += [file for file in inside if file not in scenarios]
    return list(found), others


def plan(
    files: Sequence[Path], results: Path, overrides: Sequence[tuple[str, str]] = ()
) -> list[Job]:
    """Return one job per file, its results below `results`, in a folder with the file's name.

    Raises `InputError` where two would share a folder.
    """
    first: dict[str, Path] = {}
    problems = []
    for file in files:
        other = first.setdefault(file.stem, file)
        if other is not file:
            both = f"'{other}' and '{file}' would both write to '{results / file.stem}'"
            problems.append(Problem(f"{both}; rename one, or run them one by one"))
    if problems:
        raise InputError(problems)
    return [Job(file, results / file.stem, tuple(overrides)) for file in files]


def is_scenario(file: Path) -> bool:
    """Whether a YAML file has a road, as every scenario must; one that cannot be read counts."""
    fields = fields_of(file)
    return fields is None or "road" in fields


def fields_of(file: Path) -> dict[str, Any] | None:
    """Return the fields of a YAML file, unchecked; nothing where it has none, None where it cannot
    be read.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        data = YAML(typ="safe", pure=True).load(file.read_text(encoding="utf-8"))
    except (YAMLError, ValueError, OSError):
        return None
    return data if isinstance(data, dict) else {}
