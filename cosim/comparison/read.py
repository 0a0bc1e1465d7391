"""Runs from the folders that `cosim run` left."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError, Problem, did_you_mean
from cosim.results import RESULT_FILES

Array = npt.NDArray[np.float64]

METRICS: Final = "metrics.json"
assert METRICS in RESULT_FILES


@dataclass(frozen=True)
class ComparedRun:
    """One run: its name in the comparison, its scenario's name, its figures as in metrics.json, and
    the folder that its signals lie in.
    """

    name: str
    scenario: str
    figures: Mapping[str, Any]
    folder: Path

    def signals(self, names: Sequence[str]) -> dict[str, Array]:
        """Return `time` and those of the signals (rows,) that the run has, none without a file.

        Raises `InputError` for a file that cannot be read.
        """
        for end, read in _READERS.items():
            file = self.folder / f"signals.{end}"
            if not file.is_file():
                continue
            try:
                return read(file, ("time", *names))
            except ValueError as error:  # what pandas and pyarrow raise for a file that is no table
                raise InputError(f"'{file}' cannot be read: {error}") from None
        return {}


def read_runs(paths: Sequence[Path]) -> list[ComparedRun]:
    """Return the runs in folders of results: all of a scenario's, or the one of a run's own folder.

    Each is named by its run where that tells them apart, else with as many of the folders above it
    as that takes.
    Raises `InputError` with everything wrong: no results in a folder, a run twice, fewer than two.
    """
    found: dict[Path, tuple[str, str, Mapping[str, Any], Path]] = {}
    problems: list[Problem] = []
    for path in paths:
        try:
            runs = _runs_in(path)
        except InputError as error:
            problems += error.problems
            continue
        for one in runs:
            if one[3].resolve() in found:
                problems.append(Problem(f"'{one[3]}' is given twice"))
            found[one[3].resolve()] = one
    if not problems and len(found) < 2:
        problems.append(Problem("a comparison needs two runs or more; this is one"))
    if problems:
        raise InputError(problems)
    return _named(list(found.values()))


def _runs_in(path: Path) -> list[tuple[str, str, Mapping[str, Any], Path]]:
    """Return label, scenario, figures and folder of the runs that a path stands for."""
    if (path / METRICS).is_file():
        metrics = _metrics(path)
        runs = metrics["runs"]
        # A run that is alone lies in the folder itself, unless others beside it never ended.
        folders = {label: path / label if (path / label).is_dir() else path for label in runs}
        return [(label, metrics["scenario"], runs[label], folders[label]) for label in runs]
    parent = path.resolve().parent
    if (parent / METRICS).is_file():
        metrics = _metrics(parent)
        if path.name in metrics["runs"]:
            return [(path.name, metrics["scenario"], metrics["runs"][path.name], path)]
        hint = did_you_mean(path.name, metrics["runs"])
        raise InputError(f"'{parent}' has no run '{path.name}'{hint}")
    what = "is no folder" if not path.is_dir() else f"holds no {METRICS}"
    raise InputError(f"'{path}' {what}; give a folder that cosim run has written")


def _metrics(folder: Path) -> dict[str, Any]:
    file = folder / METRICS
    try:
        metrics = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"'{file}' cannot be read: {error}") from None
    if not isinstance(metrics, dict) or not {"scenario", "runs"} <= metrics.keys():
        raise InputError(f"'{file}' is not what cosim run writes: it has no scenario or no runs")
    runs = metrics["runs"]
    if not isinstance(runs, dict) or not all(isinstance(run, dict) for run in runs.values()):
        raise InputError(f"'{file}' is not what cosim run writes: its runs have no figures by name")
    return metrics


def _named(runs: list[tuple[str, str, Mapping[str, Any], Path]]) -> list[ComparedRun]:
    labels = [label for label, *_ in runs]
    above = [_above(label, folder) for label, *_, folder in runs]
    named = []
    for (label, scenario, figures, folder), parts in zip(runs, above, strict=True):
        same = [a for other, a in zip(labels, above, strict=True) if other == label]
        depth = 0 if len(same) == 1 else _depth(same)
        name = "/".join((*parts[len(parts) - min(depth, len(parts)) :], label))
        named.append(ComparedRun(name, scenario, figures, folder))
    return named


def _above(label: str, folder: Path) -> tuple[str, ...]:
    """Return the names of the folders that a run's results lie in, its scenario's the last."""
    own = folder.resolve()
    parts = (own.parent if own.name == label else own).parts
    return tuple(part for part in parts if part != own.anchor)


def _depth(folders: Sequence[tuple[str, ...]]) -> int:
    """Return how many names, from the end on, tell these folders apart."""
    longest = max(len(parts) for parts in folders)
    depths = (n for n in range(1, longest) if len({p[-n:] for p in folders}) == len(folders))
    return next(depths, longest)


def _csv(file: Path, names: Sequence[str]) -> dict[str, Array]:
    import pandas as pd

    wanted = set(names)
    frame = pd.read_csv(file, usecols=lambda header: str(header).split(" [")[0] in wanted)
    return {str(header).split(" [")[0]: frame[header].to_numpy(np.float64) for header in frame}


def _parquet(file: Path, names: Sequence[str]) -> dict[str, Array]:
    from cosim.recorder import require_parquet

    require_parquet()
    import pyarrow.parquet as pq

    there = [name for name in names if name in pq.read_schema(file).names]
    table = pq.read_table(file, columns=there)
    return {name: table[name].to_numpy().astype(np.float64) for name in there}


_READERS: Final = {"csv": _csv, "parquet": _parquet}
