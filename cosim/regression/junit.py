"""Verdicts as JUnit XML, as build servers read it.

The form is that which both Ant's schema and Jenkins' accept: a suite for each run of a scenario,
its figures as properties, a case for the run itself and one for each limit and golden.
"""

from __future__ import annotations

import platform
import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from cosim.batch.job import Ended, RunEnd
from cosim.verdict import Verdict

RUN_CASE: Final = "runs to its end"
# What XML 1.0 cannot carry, such as the escapes of a terminal.
_FORBIDDEN: Final = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_junit(path: Path, ended: Sequence[Ended], started: datetime) -> None:
    """Write the verdicts on scenarios; raises `OSError`."""
    root = ET.Element("testsuites")
    for number, (one, run) in enumerate(_suites(ended)):
        root.append(_suite(one, run, number, started))
    ET.indent(root)
    path.parent.mkdir(parents=True, exist_ok=True)
    ET.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


def _suites(ended: Sequence[Ended]) -> Iterator[tuple[Ended, RunEnd]]:
    """Yield each run; what could not begin counts as one that did not end."""
    for one in ended:
        runs = one.runs or (RunEnd("check", exit_code=one.exit_code, problems=one.problems),)
        for run in runs:
            yield one, run


def _suite(one: Ended, run: RunEnd, number: int, started: datetime) -> ET.Element:
    file = one.job.scenario
    name = file.stem if len(one.runs) < 2 else f"{file.stem} ({run.label})"
    cases = [_run_case(one, run), *_verdict_cases(one, run)]
    suite = ET.Element("testsuite", {
        "name": _clean(name), "package": _clean(_dotted(file.parent) or "."),
        "id": str(number), "hostname": platform.node() or "localhost",
        "timestamp": started.isoformat(timespec="seconds"), "time": f"{run.wall_s:.3f}",
        "tests": str(len(cases)),
        **{f"{kind}s": str(sum(case.find(kind) is not None for case in cases))
           for kind in ("failure", "error")},
    })  # fmt: skip
    properties = ET.SubElement(suite, "properties")
    for key, value in _properties(one, run):
        ET.SubElement(properties, "property", name=_clean(key), value=_clean(value))
    suite.extend(cases)
    ET.SubElement(suite, "system-out").text = _clean("\n".join(one.notes))
    # What follows the frames is a list of the modules that are loaded.
    stack = run.death.stack.partition("\nExtension modules")[0] if run.death is not None else ""
    ET.SubElement(suite, "system-err").text = _clean("\n".join((*run.problems, stack)).strip())
    return suite


def _run_case(one: Ended, run: RunEnd) -> ET.Element:
    case = _case(one, run, RUN_CASE, run.wall_s)
    if run.figures is None:
        kind = run.death.kind if run.death is not None else "error"
        message = "; ".join(run.problems) or "it did not end"
        ET.SubElement(case, "error", type=kind, message=_clean(message)).text = _clean(message)
    return case


def _verdict_cases(one: Ended, run: RunEnd) -> Iterator[ET.Element]:
    seen: Counter[str] = Counter()
    for verdict in verdicts_of(one, run.label):
        seen[verdict.metric] += 1
        times = seen[verdict.metric]
        case = _case(one, run, f"{verdict.metric} #{times}" if times > 1 else verdict.metric, 0.0)
        if not verdict.passed:
            words = _clean(f"is {verdict.measured}, required {verdict.required}")
            ET.SubElement(case, "failure", type="limit", message=words).text = words
        yield case


def _case(one: Ended, run: RunEnd, name: str, wall_s: float) -> ET.Element:
    place = _dotted(one.job.scenario.with_suffix(""))
    where = place if len(one.runs) < 2 else f"{place}.{run.label}"
    return ET.Element(
        "testcase", name=_clean(name), classname=_clean(where), time=f"{wall_s:.3f}"
    )  # fmt: skip


def _dotted(path: Path) -> str:
    """Return a path as names of packages, seen from the working folder where it lies below it; a
    dot in a name of its own would part it.
    """
    here = Path.cwd()
    below = path.relative_to(here) if path.is_relative_to(here) else path
    names = [part for part in below.parts if part not in (below.anchor, "..")]
    return ".".join(name.replace(".", "_") for name in names)


def verdicts_of(one: Ended, label: str) -> list[Verdict]:
    """Return the verdicts on one run of a scenario."""
    if one.metrics is None:
        return []
    return [Verdict(**found) for found in one.metrics["limits"] if found["run"] == label]


def _properties(one: Ended, run: RunEnd) -> Iterator[tuple[str, str]]:
    yield "scenario", one.job.scenario.as_posix()
    yield "results", one.job.output_dir.as_posix()
    yield from figures_of(one, run.label)
    if run.figures is None and run.last_s is not None:
        yield "last_sample_s", f"{run.last_s:.10g}"


def figures_of(one: Ended, label: str) -> Iterator[tuple[str, str]]:
    """Yield the figures of one run of a scenario, by their dotted path."""
    if one.metrics is not None:
        yield from _flat("", one.metrics["runs"].get(label, {}))


def _flat(above: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(f"{above}.{key}" if above else str(key), item)
    elif isinstance(value, str) or (isinstance(value, int | float) and value is not None):
        yield above, str(value).lower() if isinstance(value, bool) else str(value)


def _clean(text: str) -> str:
    return _FORBIDDEN.sub("?", text)
