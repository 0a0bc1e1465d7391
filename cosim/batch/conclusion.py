"""The results of a scenario, from what its runs have left behind."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from cosim import black_box
from cosim.batch.job import Ended, Job, RunEnd
from cosim.provenance import add_files
from cosim.recorder import Recorder
from cosim.regression.goldens import accept, golden_verdicts
from cosim.results import folder_of, write_json
from cosim.run import RunOutcome, conclude
from cosim.scenario.schema import Scenario


def judged(
    scenario: Scenario, job: Job, runs: Sequence[RunEnd], problems: tuple[str, ...]
) -> Ended:
    """Judge the runs that have figures, write the results and return how the job ended.

    `problems` are those of the others.
    """
    ended = [run for run in runs if run.figures is not None]
    records = {run.label: _record(scenario, job, run.label) for run in ended}
    versions = json.loads((job.output_dir / "versions.json").read_text("utf-8"))
    for run in ended:
        add_files(versions, run.files, run.label)
    write_json(job.output_dir / "versions.json", versions)
    outcomes = [RunOutcome(r.label, records[r.label], dict(r.figures or {})) for r in ended]
    moved = () if job.goldens != "accept" else tuple(accept(scenario, records))
    judge = None if job.goldens == "ignore" else golden_verdicts
    outcome = conclude(scenario, job.output_dir, outcomes, versions, judge)
    for run in ended:
        _box(scenario, job, run.label).unlink()
    code = max(outcome.exit_code, *(run.exit_code for run in runs))
    return Ended(job, code, problems, outcome.metrics, outcome.notes, tuple(runs), moved)


def _box(scenario: Scenario, job: Job, label: str) -> Path:
    return folder_of(scenario, job.output_dir, label) / black_box.NAME


def _record(scenario: Scenario, job: Job, label: str) -> Recorder:
    return Recorder.recovered(_box(scenario, job, label))
