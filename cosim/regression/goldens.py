"""Goldens of a scenario: its runs judged by them, and new ones accepted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from cosim.limits import asked_of, window
from cosim.recorder import Recorder
from cosim.regression.golden_file import Course, GoldenFile, Kept, golden_path, read_golden, text_of
from cosim.regression.tube import distance
from cosim.scenario.golden import Golden
from cosim.scenario.schema import Scenario
from cosim.verdict import Verdict

HOW = "cosim test --accept makes it"


def golden_verdicts(scenario: Scenario, records: Mapping[str, Recorder]) -> list[Verdict]:
    """Return the verdict on each golden signal of each of these runs, and on where the run ends.

    The value of a verdict is the largest distance from the golden, in the signal's unit. Raises
    `InputError` where a file of goldens is damaged.
    """
    verdicts = []
    for run, asked in _by_run(scenario.goldens, records).items():
        record = records[run]
        file = read_golden(_path(scenario, run), record.step_s)
        if file is None:
            remark = f"there is none yet; {HOW}"
            verdicts.append(Verdict(run, "file of goldens", None, None, None, False, remark=remark))
            continue
        verdicts.append(_end(run, record, file, [golden for golden, _ in asked]))
        verdicts += [_judged(run, name, golden, record, file) for golden, name in asked]
    return verdicts


def accept(scenario: Scenario, records: Mapping[str, Recorder]) -> Iterator[str]:
    """Write the goldens of these runs, and yield a sentence on each signal that has moved.

    Files of runs that the scenario no longer has are taken away. Raises `OSError`.
    """
    for run, asked in _by_run(scenario.goldens, records).items():
        path, record = _path(scenario, run), records[run]
        before = _readable(path, record.step_s)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text_of(record, _kept(asked, record)), "utf-8")
        yield from _moved(run, asked, record, before)
    yield from _removed(scenario)


def _by_run(
    goldens: Sequence[Golden], records: Mapping[str, Recorder]
) -> dict[str, list[tuple[Golden, str]]]:
    """Return the goldens of each run that has some, with the name of each one's signal."""
    found: dict[str, list[tuple[Golden, str]]] = {}
    for golden in goldens:
        for run, name in asked_of(golden.signal, records).items():
            if any(signal.name == name for signal in records[run].signals):
                found.setdefault(run, []).append((golden, name))
    return found


def _path(scenario: Scenario, run: str) -> Path:
    return golden_path(Path(str(scenario.file)), run)


def _readable(path: Path, step_s: float) -> GoldenFile | None:
    """Return what is there to be replaced, None if that cannot be read."""
    from cosim.errors import InputError

    try:
        return read_golden(path, step_s)
    except InputError:
        return None


def _kept(asked: Sequence[tuple[Golden, str]], record: Recorder) -> list[Kept]:
    signals = {signal.name: signal for signal in record.signals}
    return [
        Kept(signals[name], window(record.time, g.from_s, g.to_s), g.tolerance) for g, name in asked
    ]


# ---------------------------------------------------------------- verdicts


def _end(run: str, record: Recorder, file: GoldenFile, goldens: Sequence[Golden]) -> Verdict:
    """Return the verdict on when the run ended."""
    slack = max(golden.time_tolerance_s for golden in goldens) + 1e-9
    ended, golden = float(record.time[-1]), file.last * record.step_s
    low, high = golden - slack, golden + slack
    return Verdict(
        run, "golden end of the run", ended, low, high, low <= ended <= high, unit="s"
    )  # fmt: skip


def _judged(run: str, name: str, golden: Golden, record: Recorder, file: GoldenFile) -> Verdict:
    def verdict(value: float | None, at_s: float | None = None, remark: str = "") -> Verdict:
        passed = value is not None and value <= golden.tolerance
        unit = next(signal.unit for signal in record.signals if signal.name == name)
        what = f"distance of {name} from its golden"
        return Verdict(
            run, what, value, None, golden.tolerance, passed, None, unit, at_s, remark
        )  # fmt: skip

    course = file.courses.get(name)
    if course is None or not len(course.rows):
        return verdict(None, remark=f"it is not in the file of goldens; {HOW}")
    found = _farthest(record, name, golden, course)
    if found is None:
        return verdict(None, remark="the run and its golden have no sample in common")
    value, at_s = found
    if np.isinf(value):
        return verdict(None, remark=f"only one of them is a number at {at_s:g} s")
    return verdict(value, at_s)


def _farthest(
    record: Recorder, name: str, golden: Golden, course: Course
) -> tuple[float, float] | None:
    """Return the largest distance between a signal and its golden, and when that was [s]."""
    rows = window(record.time, golden.from_s, golden.to_s)
    first = max(rows.start, int(course.rows[0]))
    last = min(rows.stop - 1, int(course.rows[-1]))
    if first > last:
        return None
    values = record.columns([name])[first : last + 1, 0]
    tolerance = golden.time_tolerance_s / record.step_s
    apart = distance(values, course.over(first, last), tolerance)
    at = int(np.argmax(apart))
    return float(apart[at]), float(record.time[first + at])


# ---------------------------------------------------------------- what has moved


def _moved(
    run: str, asked: Sequence[tuple[Golden, str]], record: Recorder, before: GoldenFile | None
) -> Iterator[str]:
    """Yield a sentence on each signal of a run that is new or has moved by more than the digits of
    its golden, and on an end at another time.
    """
    ended, step = record.rows - 1, record.step_s
    if before is not None and before.last != ended:
        yield f"{run}: it ends at {ended * step:g} s, not at {before.last * step:g} s"
    for golden, name in asked:
        course = before.courses.get(name) if before is not None else None
        if course is None or not len(course.rows):
            yield f"{run}: {name} is new"
            continue
        found = _farthest(record, name, golden, course)
        if found is None:
            yield f"{run}: {name} has other times than before"
        elif found[0] > golden.tolerance * 0.101:  # what thinning and digits leave
            share = 100.0 * found[0] / golden.tolerance
            unit = f" {course.unit}".rstrip()
            yield (
                f"{run}: {name} has moved by {found[0]:.4g}{unit} at {found[1]:g} s, "
                f"{share:.0f} % of its tolerance"
            )


def _removed(scenario: Scenario) -> Iterator[str]:
    """Take away the files of runs without goldens, and yield their names."""
    wanted = {
        run
        for golden in scenario.goldens
        for run in asked_of(golden.signal, [c.label for c in scenario.controllers])
    }
    for path in sorted(_path(scenario, "any").parent.glob("*.csv")):
        if path.stem not in wanted:
            path.unlink()
            yield f"{path.stem}: its goldens are taken away"
