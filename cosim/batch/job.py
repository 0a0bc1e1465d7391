"""What goes to a process and what comes back."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Job:
    """One scenario to run: its file, where its results go, and overrides with their labels."""

    scenario: Path
    output_dir: Path
    overrides: tuple[tuple[str, str], ...] = ()

    @property
    def command(self) -> str:
        """The command line that runs this scenario alone."""
        options = [word for _, label in self.overrides for word in label.split(" ", 1)]
        return shlex.join(["cosim", "run", str(self.scenario), *options])


@dataclass(frozen=True)
class Ended:
    """How a job ended: its exit code, what went wrong in sentences, and its metrics.json.

    After the check alone there are no metrics; `longest_s` is the simulated time that the run may
    take [s].
    """

    job: Job
    exit_code: int = 0
    problems: tuple[str, ...] = ()
    metrics: Mapping[str, Any] | None = None
    notes: tuple[str, ...] = ()
    longest_s: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return it as `cosim run --json` shows it."""
        return {
            "scenario": str(self.job.scenario),
            "output_dir": str(self.job.output_dir),
            "exit_code": self.exit_code,
            "problems": list(self.problems),
            "metrics": self.metrics,
        }
