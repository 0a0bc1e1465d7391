"""Limits of a scenario: their names before the run, their verdicts after it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol, TypeVar

from cosim.errors import did_you_mean
from cosim.metrics import LATENESS, MANOEUVRE_FIGURES, figure, metric_names, with_unit


class Bounds(Protocol):
    """What a limit asks for; `cosim.scenario.limit.Limit` is one."""

    @property
    def metric(self) -> str:
        """Dotted path of the figure."""

    @property
    def min(self) -> float | None:
        """Smallest value that passes."""

    @property
    def max(self) -> float | None:
        """Largest value that passes."""

    @property
    def surface(self) -> str | None:
        """The only surface that it counts on; None for all."""


L = TypeVar("L", bound=Bounds)


@dataclass(frozen=True)
class Verdict:
    """One limit in one run. `value` is None where the run has no such figure, which fails;
    `surface` is the one that the limit is made for.
    """

    run: str
    metric: str
    value: float | None
    min: float | None
    max: float | None
    passed: bool
    surface: str | None = None

    @property
    def required(self) -> str:
        """What was asked for, in words."""
        low = f"at least {with_unit(self.min, self.metric)}" if self.min is not None else ""
        high = f"at most {with_unit(self.max, self.metric)}" if self.max is not None else ""
        on = f" (surface {self.surface})" if self.surface is not None else ""
        return " and ".join(words for words in (low, high) if words) + on

    @property
    def measured(self) -> str:
        """What was found, in words."""
        return "not available" if self.value is None else with_unit(self.value, self.metric)

    def __str__(self) -> str:
        outcome = "passed" if self.passed else "FAILED"
        return f"{outcome}: {self.run}: {self.metric} is {self.measured}, required {self.required}"

    def as_dict(self) -> dict[str, Any]:
        """Return the verdict as it stands in metrics.json."""
        return asdict(self)


def check_metric(
    metric: str, labels: Sequence[str], manoeuvre: str | None = None, faults: Sequence[str] = ()
) -> str | None:
    """Return what is wrong with the name of a metric in a scenario with this kind of manoeuvre and
    these faults, or None.
    """
    names = metric_names(labels, manoeuvre, faults)
    if metric in names:
        return None
    kinds = _kinds_of(metric, labels)
    if kinds:
        here = f"not of {manoeuvre}" if manoeuvre else "and this scenario has none"
        return f"'{metric}' is a figure of the manoeuvre {kinds}, {here}"
    hint = did_you_mean(metric, names)
    return f"'{metric}' is not a metric{hint or ', such as sensor.overall.accuracy_percent'}"


def _kinds_of(metric: str, labels: Sequence[str]) -> str:
    """Return the kinds of manoeuvre that have this figure, in words; nothing for another metric."""
    label, _, rest = metric.partition(".")
    name = (rest if label in labels else metric).removeprefix("manoeuvre.")
    kinds = [kind for kind, names in MANOEUVRE_FIGURES.items() if name in names]
    return " or ".join(kinds) if name != metric else ""


def counted(
    limits: Sequence[L], surface: str | None, real_time: object | None
) -> tuple[list[L], tuple[str, ...]]:
    """Return the limits that count on a surface (None stands for a road file's own) and with or
    without real time, and a note on each kind that is left out.
    """
    here = [limit for limit in limits if limit.surface in (None, surface)]
    others = [limit for limit in limits if limit not in here]
    late = [limit for limit in here if real_time is None and _is_lateness(limit.metric)]
    notes = []
    if others:
        names = ", ".join(sorted({str(limit.surface) for limit in others}))
        word = "another surface" if len(others) == 1 else "other surfaces"
        notes.append(f"{_number(others)} for {word} ({names}) and left out on {surface}")
    if late:
        notes.append(f"{_number(late)} for runs in real time and left out")
    return [limit for limit in here if limit not in late], tuple(notes)


def _is_lateness(metric: str) -> bool:
    return any(metric.endswith(f"timing.{name}") for name in LATENESS)


def _number(limits: Sequence[object]) -> str:
    return "1 limit is" if len(limits) == 1 else f"{len(limits)} limits are"


def evaluate(limits: Iterable[Bounds], runs: Mapping[str, Mapping[str, Any]]) -> list[Verdict]:
    """Return one verdict per limit and run, or for one run where the limit begins with its name."""
    verdicts = []
    for limit in limits:
        label, _, rest = limit.metric.partition(".")
        chosen = {label: rest} if label in runs else dict.fromkeys(runs, limit.metric)
        for run, path in chosen.items():
            value = figure(runs[run], path)
            # A comparison with NaN is false, so a figure that is not a number fails.
            passed = value is not None and (
                (limit.min is None or value >= limit.min)
                and (limit.max is None or value <= limit.max)
                and value == value
            )
            bounds = limit.min, limit.max
            verdicts.append(Verdict(run, path, value, *bounds, passed, limit.surface))
    return verdicts
