"""`cosim sensor evaluate`: recorded runs, estimators and measurement conditions, in processes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.errors import InputError, Problem, did_you_mean
from cosim.tables import Table, number

if TYPE_CHECKING:
    from sensor.evaluation import Pair

Tell = Callable[[str], None]
Content = dict[str, Any]


@dataclass(frozen=True)
class Plan:
    """What to evaluate: files of runs, estimators and conditions, each pair with what its figures
    depend on.
    """

    files: tuple[Path, ...]
    estimators: tuple[str, ...]
    fingerprints: Mapping[Pair, str]

    @property
    def conditions(self) -> tuple[str, ...]:
        """The measurement conditions."""
        return tuple(dict.fromkeys(condition for condition, _ in self.fingerprints))


def plan(
    directory: Path, estimators: Sequence[str] | None, conditions: Sequence[str] | None
) -> Plan:
    """Choose all Parquet files of `directory`, and the estimators and conditions that are named,
    else every condition and every estimator that is shipped. Raises `InputError` naming whatever
    there is not.
    """
    from sensor.conditions import CONDITIONS
    from sensor.estimators import names

    files = tuple(sorted(directory.glob("*.parquet")))
    problems = [] if files else [Problem(f"there is no run (*.parquet) in '{directory}'")]
    for what, given, known in (
        ("estimator", estimators, names()),
        ("condition", conditions, CONDITIONS),
    ):
        problems += [
            Problem(f"--{what}s: there is no {what} '{name}'{did_you_mean(name, known)}")
            for name in given or ()
            if name not in known
        ]
    if problems:
        raise InputError(problems)
    chosen = [condition for condition in CONDITIONS if condition in (conditions or CONDITIONS)]
    found = _fingerprints(estimators, chosen)
    shipped = tuple(dict.fromkeys(name for _, name in found))
    return Plan(files, shipped, found)


def _fingerprints(estimators: Sequence[str] | None, conditions: Sequence[Any]) -> dict[Pair, str]:
    """Return the fingerprint of each pair; of all estimators, those whose files are shipped."""
    from sensor import SensorError
    from sensor.estimators import names
    from sensor.fingerprint import fingerprint

    found: dict[Pair, str] = {}
    problems: dict[str, None] = {}
    for name in estimators or names():
        try:
            found |= {(one, name): fingerprint(name, one) for one in conditions}
        except SensorError as error:
            problems[str(error)] = None
    if estimators and problems:
        raise InputError([Problem(words) for words in problems])
    return found


def evaluate_all(chosen: Plan, before: Content | None, processes: int, tell: Tell) -> Content:
    """Evaluate every run, the longest first; return the records in the order of their names, with
    where they come from.

    What `before` has of the same run and fingerprint is taken from there. `tell` hears the name of
    each run that is done.
    """
    from sensor.fingerprint import digest
    from sensor.provenance import versions

    digests = {file: digest(file) for file in chosen.files}
    records = {file: _kept(chosen, before or {}, file.stem, digests[file]) for file in chosen.files}
    missing = {
        file: tuple(pair for pair in chosen.fingerprints if not _has(records[file], pair))
        for file in sorted(chosen.files, key=lambda file: file.stat().st_size, reverse=True)
    }
    for file in chosen.files:
        if not missing[file]:
            tell(file.stem)
    for file, record in _evaluated({f: pairs for f, pairs in missing.items() if pairs}, processes):
        _add(records[file], record)
        tell(file.stem)
    return {
        "provenance": versions(),
        "units": {"velocities": "m/s", "accuracy": "%", "sign_agreement": "%", "coverage": "%"},
        "estimators": list(chosen.estimators),
        "conditions": list(chosen.conditions),
        "fingerprints": _by_condition(chosen.fingerprints),
        "runs": [
            {"name": file.stem, "sha256": digests[file], **_ordered(records[file], chosen)}
            for file in chosen.files
        ],
    }


def _evaluated(
    work: Mapping[Path, tuple[Pair, ...]], processes: int
) -> Iterator[tuple[Path, Content]]:
    """Yield the record of each run as it is done; with one process, in this one."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor, as_completed

    from sensor import SensorError
    from sensor.evaluation import evaluate_run

    try:
        if processes == 1 or len(work) < 2:
            for file, pairs in work.items():
                yield file, evaluate_run(file, pairs)
            return
        with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as executor:
            started = {executor.submit(evaluate_run, *one): one[0] for one in work.items()}
            try:
                for done in as_completed(started):
                    yield started[done], done.result()
            except BaseException:
                executor.shutdown(cancel_futures=True)
                raise
    except SensorError as error:
        raise InputError(str(error)) from None


def read_before(path: Path) -> Content | None:
    """Return what an earlier evaluation wrote, None if there is no such file, or none to read."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return content if isinstance(content, dict) and "fingerprints" in content else None
    except (OSError, ValueError):
        return None


def _kept(chosen: Plan, before: Content, stem: str, sha256: str) -> Content:
    """Return what is still true of a run's earlier record."""
    earlier = next((run for run in before.get("runs", ()) if run["name"] == stem), None)
    if earlier is None or earlier["sha256"] != sha256:
        return {"figures": {}}
    figures: dict[str, Content] = {}
    for (condition, name), fingerprint in chosen.fingerprints.items():
        if before["fingerprints"].get(condition, {}).get(name) == fingerprint:
            figures.setdefault(condition, {})[name] = earlier["figures"][condition][name]
    return {"recipe": earlier["recipe"], "samples": earlier["samples"], "figures": figures}


def _has(record: Content, pair: Pair) -> bool:
    condition, name = pair
    return name in record["figures"].get(condition, {})


def _add(record: Content, evaluated: Content) -> None:
    record |= {"recipe": evaluated["recipe"], "samples": evaluated["samples"]}
    for condition, figures in evaluated["figures"].items():
        record["figures"].setdefault(condition, {}).update(figures)


def _ordered(record: Content, chosen: Plan) -> Content:
    """Return the record with its figures in the order of the plan, whatever was there before."""
    figures = {
        condition: {name: record["figures"][condition][name] for name in chosen.estimators}
        for condition in chosen.conditions
    }
    return {"recipe": record["recipe"], "samples": record["samples"], "figures": figures}


def _by_condition(values: Mapping[Pair, str]) -> dict[str, dict[str, str]]:
    found: dict[str, dict[str, str]] = {}
    for (condition, name), value in values.items():
        found.setdefault(condition, {})[name] = value
    return found


def overview(evaluated: Content) -> Table:
    """Return all runs pooled: a row per condition and estimator."""
    from sensor.metrics import BANDS, MODES, pool

    columns = (
        "estimator", "condition", "RMSE [m/s]", "accuracy [%]", "on presumed target [%]",
        "right sign [%]", *(f"{part} [%]" for part in (*MODES, *BANDS)), "covered [%]",
    )  # fmt: skip
    rows = []
    for condition in evaluated["conditions"]:
        for estimator in evaluated["estimators"]:
            found = pool([run["figures"][condition][estimator] for run in evaluated["runs"]])
            parts = {**found["modes"], **found["bands"]}
            cells = [
                number(found["overall"]["rmse"]),
                number(found["overall"]["accuracy"], 1),
                number(found["projected"]["accuracy"], 1),
                number(found["overall"]["sign_agreement"], 1),
                *(number(parts[name]["accuracy"], 1) for name in (*MODES, *BANDS)),
                _covered(found["coverage"]),
            ]
            rows.append((estimator, condition, *cells))
    samples = sum(record["samples"] for record in evaluated["runs"])
    title = f"{len(evaluated['runs'])} runs pooled, {samples} samples; accuracy by mode and band"
    return Table(title, columns, tuple(rows))


def _covered(coverage: Mapping[str, float] | None) -> str:
    """Least and largest share of errors within the predicted 90 % band, over the wheels."""
    if coverage is None:
        return "-"
    return f"{min(coverage.values()):.1f} … {max(coverage.values()):.1f}"
