"""Limits of a scenario: their names before the run, their verdicts after it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from cosim.errors import did_you_mean
from cosim.metrics import LATENESS, MANOEUVRE_FIGURES, figure, metric_names
from cosim.recorder import Recorder
from cosim.signal_statistics import Statistic, statistic, worst
from cosim.verdict import Verdict

Array = npt.NDArray[np.float64]


class Bounds(Protocol):
    """What a limit asks for; `cosim.scenario.limit.Limit` is one."""

    @property
    def metric(self) -> str | None:
        """Dotted path of the figure, None for a limit on a signal."""

    @property
    def signal(self) -> str | None:
        """Name of the signal, None for a limit on a figure."""

    @property
    def statistic(self) -> Statistic:
        """What of the signal is bounded."""

    @property
    def from_s(self) -> float | None:
        """Where the signal's window begins [s], None for its beginning."""

    @property
    def to_s(self) -> float | None:
        """Where the signal's window ends [s], None for its end."""

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


def run_of(limit: Bounds) -> str:
    """Return what a limit begins with: the name of a run, if it is for one alone."""
    return str(limit.metric or limit.signal).partition(".")[0]


def asked_of(name: str, runs: Iterable[str]) -> dict[str, str]:
    """Return by run what a figure or a signal is called there: the same in all, or what follows the
    name of the one run that it begins with.
    """
    label, _, rest = name.partition(".")
    runs = list(runs)
    return {label: rest} if label in runs else dict.fromkeys(runs, name)


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


def check_signal(name: str, labels: Sequence[str], signals: Sequence[str]) -> str | None:
    """Return what is wrong with the name of a signal, with or without that of a run before it, or
    None.
    """
    label, _, rest = name.partition(".")
    wanted = rest if label in labels else name
    if wanted in signals:
        return None
    hint = did_you_mean(wanted, signals)
    return f"'{wanted}' is not a recorded signal{hint or ', such as Car.az'}"


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


def _is_lateness(metric: str | None) -> bool:
    return metric is not None and any(metric.endswith(f"timing.{name}") for name in LATENESS)


def _number(limits: Sequence[object]) -> str:
    return "1 limit is" if len(limits) == 1 else f"{len(limits)} limits are"


def evaluate(
    limits: Iterable[Bounds],
    runs: Mapping[str, Mapping[str, Any]],
    records: Mapping[str, Recorder] | None = None,
) -> list[Verdict]:
    """Return one verdict per limit and run, or for one run where the limit begins with its name.

    `runs` are the figures of each run, `records` what was recorded of it.
    """
    verdicts = []
    for limit in limits:
        for run, name in asked_of(str(limit.metric or limit.signal), runs).items():
            if limit.signal is None:
                verdict = _of_figure(limit, run, name, runs[run])
            else:
                verdict = _of_signal(limit, run, name, (records or {})[run])
            verdicts.append(verdict)
    return verdicts


def _of_figure(limit: Bounds, run: str, path: str, figures: Mapping[str, Any]) -> Verdict:
    value = figure(figures, path)
    return Verdict(
        run, path, value, limit.min, limit.max, _within(limit, value), limit.surface
    )  # fmt: skip


def _of_signal(limit: Bounds, run: str, name: str, record: Recorder) -> Verdict:
    """Return the verdict on what a limit makes of a signal; none of its window is a failure."""
    rows = window(record.time, limit.from_s, limit.to_s)
    value, at_s, remark = _found(limit, record.columns([name])[rows, 0], record.time[rows])
    unit = next(signal.unit for signal in record.signals if signal.name == name)
    return Verdict(
        run, _described(limit, name), value, limit.min, limit.max, _within(limit, value),
        limit.surface, unit, at_s, remark,
    )  # fmt: skip


def _found(limit: Bounds, values: Array, time: Array) -> tuple[float | None, float | None, str]:
    """Return what is bounded of samples (n,), its time if it has one, and why there is none."""
    if not len(values):
        return None, None, "no sample in this window"
    missing = np.isnan(values)
    if missing.any():
        return None, None, f"not a number at {time[np.argmax(missing)]:g} s"
    if limit.statistic == "each":
        at: int | None = worst(values, limit.min, limit.max)
        value = float(values[at])
    else:
        value, at = statistic(limit.statistic, values)
    return value, None if at is None else float(time[at]), ""


def _within(limit: Bounds, value: float | None) -> bool:
    """Whether a value is there and within the bounds; one that is not a number is not."""
    return value is not None and (
        (limit.min is None or value >= limit.min)
        and (limit.max is None or value <= limit.max)
        and value == value
    )


def _described(limit: Bounds, name: str) -> str:
    what = name if limit.statistic == "each" else f"{limit.statistic} of {name}"
    begin = f" from {limit.from_s:g} s" if limit.from_s is not None else ""
    return what + begin + (f" to {limit.to_s:g} s" if limit.to_s is not None else "")


def window(time: Array, from_s: float | None, to_s: float | None) -> slice:
    """Return the rows at times (n,) [s], ends included."""
    slack = 1e-9  # a time is k h, and may lie a rounding error beside what was written
    first = 0 if from_s is None else int(np.searchsorted(time, from_s - slack))
    last = len(time) if to_s is None else int(np.searchsorted(time, to_s + slack))
    return slice(first, last)
