"""From a folder of runs and what is named on the command line to what is to be evaluated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.errors import InputError, Problem, did_you_mean

if TYPE_CHECKING:
    from sensor.evaluation import Pair


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
