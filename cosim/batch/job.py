"""What goes to a process and what comes back."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from cosim.isolation import Death

Goldens = Literal["ignore", "compare", "accept"]


@dataclass(frozen=True)
class Job:
    """One scenario to run: its file, where its results go, overrides with their labels, and what
    becomes of its goldens.
    """

    scenario: Path
    output_dir: Path
    overrides: tuple[tuple[str, str], ...] = ()
    goldens: Goldens = "ignore"

    @property
    def command(self) -> str:
        """The command line that runs this scenario alone."""
        options = [word for _, label in self.overrides for word in label.split(" ", 1)]
        return shlex.join(["cosim", "run", str(self.scenario), *options])


@dataclass(frozen=True)
class Checked:
    """What is known of a job before its first step: what is wrong with it, else its runs.

    `longest_s` is the simulated time that one run may take [s]; `alone` whether nothing else should
    go on beside it; `connect_s` how long a run may wait for a sensor on a bus [s]; `file_format` is
    that of the signals.
    """

    job: Job
    exit_code: int = 0
    problems: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()
    longest_s: float = 0.0
    alone: bool = False
    connect_s: float = 0.0
    file_format: Literal["csv", "parquet"] = "csv"


@dataclass(frozen=True)
class Run:
    """One run of a job, with the controller of this number, and the folder of its signals."""

    checked: Checked
    number: int

    @property
    def label(self) -> str:
        """Name of the run."""
        return self.checked.labels[self.number]

    @property
    def folder(self) -> Path:
        """Where its signals go."""
        folder = self.checked.job.output_dir
        return folder if len(self.checked.labels) == 1 else folder / self.label


@dataclass(frozen=True)
class RunEnd:
    """How a run ended: with figures, or with problems and perhaps the death of its process.

    `files` decided the result; `wall_s` is the time on the clock [s], `last_s` the simulated time
    of the last sample that was recorded [s], None if there is none.
    """

    label: str
    figures: Mapping[str, Any] | None = None
    files: Mapping[str, Path] = field(default_factory=dict)
    exit_code: int = 0
    problems: tuple[str, ...] = ()
    death: Death | None = None
    wall_s: float = 0.0
    last_s: float | None = None


@dataclass(frozen=True)
class Ended:
    """How a job ended: its exit code, what went wrong in sentences, its metrics.json, its runs, and
    what is to be said of its goldens.
    """

    job: Job
    exit_code: int = 0
    problems: tuple[str, ...] = ()
    metrics: Mapping[str, Any] | None = None
    notes: tuple[str, ...] = ()
    runs: tuple[RunEnd, ...] = ()
    moved: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return it as `cosim run --json` shows it."""
        return {
            "scenario": str(self.job.scenario),
            "output_dir": str(self.job.output_dir),
            "exit_code": self.exit_code,
            "problems": list(self.problems),
            "metrics": self.metrics,
        }
