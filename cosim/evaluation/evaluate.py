"""Runs in processes of their own; what is known already is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.errors import InputError
from cosim.evaluation.plan import Plan

if TYPE_CHECKING:
    from sensor.evaluation import Pair

Tell = Callable[[str], None]
Content = dict[str, Any]
Save = Callable[[Content], None]


def evaluate_all(
    chosen: Plan, before: Content | None, processes: int, tell: Tell, save: Save
) -> None:
    """Evaluate every run, the longest first, and `save` the records in the order of their names,
    with where they come from; those that are done even when the work is broken off.

    What `before` has of the same run and fingerprint is taken from there. `tell` hears the name of
    each run that is done.
    """
    from sensor.fingerprint import digest

    digests = {file: digest(file) for file in chosen.files}
    records = {file: _kept(chosen, before or {}, file.stem, digests[file]) for file in chosen.files}
    missing = {
        file: tuple(pair for pair in chosen.fingerprints if not _has(records[file], pair))
        for file in sorted(chosen.files, key=lambda file: file.stat().st_size, reverse=True)
    }
    for file in chosen.files:
        if not missing[file]:
            tell(file.stem)
    try:
        for file, record in _evaluated({f: p for f, p in missing.items() if p}, processes):
            _add(records[file], record)
            tell(file.stem)
    finally:
        done = [
            {"name": file.stem, "sha256": digests[file], **_ordered(record, chosen)}
            for file, record in records.items()
            if all(_has(record, pair) for pair in chosen.fingerprints)
        ]
        save(_content(chosen, done))


def _content(chosen: Plan, runs: list[Content]) -> Content:
    from sensor.provenance import versions

    return {
        "provenance": versions(),
        "units": {"velocities": "m/s", "accuracy": "%", "sign_agreement": "%", "coverage": "%"},
        "estimators": list(chosen.estimators),
        "conditions": list(chosen.conditions),
        "fingerprints": _by_condition(chosen.fingerprints),
        "runs": runs,
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
