"""`cosim test`: from files and folders to verdicts."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

import click

from cosim import show
from cosim.batch import Job, find_scenarios, plan, run_all
from cosim.batch.plan import fields_of
from cosim.errors import InputError
from cosim.regression import show as regression_show
from cosim.regression.junit import write_junit

SECTIONS: Final = ("limits", "goldens")
BROKEN: Final = 3  # the exit code of an FMU or a network that fails: of a test, a failure


@dataclass(frozen=True)
class Options:
    """How tests are run: where their results go, how many at once, how long one may stand still
    [s], whether goldens are accepted, and where the verdicts go as XML.
    """

    results: Path
    processes: int
    timeout: float
    accept: bool = False
    junit: Path | None = None
    as_json: bool = False


def run(paths: Sequence[Path], options: Options) -> int:
    """Run the tests, show and write their verdicts, and return the exit code: 1 where one failed,
    2 where one is wrong before its first step and none was run.
    """
    started = datetime.now()
    jobs = jobs_of(paths, options.results, options.accept)
    tell = show.counter(len(jobs))
    ended, were_run = run_all(jobs, options.processes, tell, options.timeout, (BROKEN,))
    if were_run:
        regression_show.outcome(ended)
    else:
        show.problems(ended)
    if options.junit is not None:
        write_junit(options.junit, ended, started)
    if options.as_json:
        json.dump([one.as_dict() for one in ended], sys.stdout, indent=2, ensure_ascii=False)
        sys.stdout.write("\n")
    worst = max(one.exit_code for one in ended)
    return min(worst, 1) if were_run else worst


def jobs_of(paths: Sequence[Path], results: Path, accept: bool) -> list[Job]:
    """Return a job for each scenario with limits or goldens; a file that is named itself counts
    without them too. Raises `InputError` where there is none.
    """
    files, others = find_scenarios(paths)
    named = {path for path in paths if not path.is_dir()}
    tests = [file for file in files if file in named or has_verdicts(file)]
    left = len(files) - len(tests) + len(others)
    if not tests:
        raise InputError("there is no scenario with limits or goldens, so nothing to test")
    if left:
        what = "1 file has" if left == 1 else f"{left} files have"
        click.echo(f"note: {what} neither limits nor goldens; left out", err=True)
    made = plan(tests, results)
    return [
        Job(job.scenario, job.output_dir, (), "accept" if accept else "compare") for job in made
    ]


def has_verdicts(file: Path) -> bool:
    """Whether a scenario has limits or goldens; one that cannot be read counts, so that its mistake
    is shown.
    """
    fields = fields_of(file)
    return fields is None or any(fields.get(section) for section in SECTIONS)
