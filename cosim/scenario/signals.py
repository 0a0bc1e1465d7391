"""The names of signals in limits and goldens."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

from cosim.errors import Problem
from cosim.limits import asked_of, check_signal
from cosim.record import record_groups, record_groups_of
from cosim.recorder import TIME
from cosim.scenario.schema import Scenario
from cosim.scenario.source import Source

SECTIONS: Final = ("limits", "goldens")


def raw_signal_problems(
    data: dict[str, Any], labels: Sequence[str], source: Source
) -> Iterator[Problem]:
    """Yield names that no run of any scenario records, on the raw values: a wrong field elsewhere
    does not hide them.
    """
    groups = record_groups("production", faults=True, late_dampers=True)
    known = [TIME.name, *(signal.name for _, signals in groups for signal in signals)]
    for section in SECTIONS:
        entries = data.get(section)
        for index, entry in enumerate(entries if isinstance(entries, list) else ()):
            name = entry.get("signal") if isinstance(entry, dict) else None
            message = check_signal(name, labels, known) if isinstance(name, str) else None
            if message:
                yield Problem(message, source.locate((section, index, "signal")))


def signal_problems(scenario: Scenario) -> Iterator[Problem]:
    """Yield signals that a run which they are asked of does not record, and goldens that a run has
    two of, in a valid scenario.
    """
    yield from _doubled_goldens(scenario)
    recorded = {}
    for controller in scenario.controllers:
        groups = record_groups_of(scenario, controller)
        recorded[controller.label] = {TIME.name} | {s.name for _, group in groups for s in group}
    for section in SECTIONS:
        for index, entry in enumerate(getattr(scenario, section)):
            if entry.signal is None:
                continue
            asked = asked_of(entry.signal, recorded)
            without = [run for run, name in asked.items() if name not in recorded[run]]
            if without:
                sentence = f"'{asked[without[0]]}' is not recorded in run {', '.join(without)}"
                yield scenario.problem(
                    (section, index, "signal"), f"{sentence}: {_when(asked[without[0]])}"
                )


def _doubled_goldens(scenario: Scenario) -> Iterator[Problem]:
    """Yield goldens of a signal that the same run has one of already."""
    seen: set[tuple[str, str]] = set()
    labels = [controller.label for controller in scenario.controllers]
    for index, golden in enumerate(scenario.goldens):
        asked = set(asked_of(golden.signal, labels).items())
        for run, name in sorted(asked & seen)[:1]:
            sentence = f"run {run} has a golden of '{name}' already"
            yield scenario.problem(("goldens", index, "signal"), sentence)
        seen |= asked


def _when(name: str) -> str:
    """Return when a signal is recorded, by the first part of its name."""
    kind = name.partition(".")[0]
    return {
        "Ideal": "it is the channel itself where the condition is ideal",
        "Measured": "it is the channel itself where there are no faults",
        "Held": "it is the command itself where latency.damper_ms is 0",
    }.get(kind, "it is not among its signals")
