"""What the processes of a batch do: check a scenario, make its folder ready, run one of its
controllers, and judge what has come of them. Nothing heavy is imported before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from cosim.batch.job import Checked, Ended, Job, Run, RunEnd
from cosim.errors import CosimError, explained
from cosim.isolation import Journal

if TYPE_CHECKING:
    from cosim.scenario.schema import Scenario

E = TypeVar("E")


@dataclass(frozen=True)
class Conclusion:
    """The runs of a job, ended in one way or another."""

    job: Job
    runs: tuple[RunEnd, ...]


def check(job: Job, journal: Journal) -> Checked:
    """Look for all that can be wrong with a scenario before its first step; build its road."""

    def look() -> Checked:
        from cosim.assembly import check as check_scenario

        scenario = _loaded(job)
        bus = scenario.sensor.bus
        return Checked(
            job,
            labels=tuple(controller.label for controller in scenario.controllers),
            longest_s=check_scenario(scenario),
            alone=scenario.real_time is not None or _shares_a_bus(scenario),
            connect_s=bus.connect_s if bus is not None else 0.0,
            file_format=scenario.output.format,
        )

    journal.call("the check of the scenario")
    return guarded(look, partial(Checked, job))


def _shares_a_bus(scenario: Scenario) -> bool:
    """Whether runs at the same time would meet on the bus of the scenario's sensor."""
    bus = scenario.sensor.bus
    return bus is not None and not bus.is_private


def prepare(job: Job, journal: Journal) -> Checked:
    """Make the folder of the results ready for the runs."""

    def make() -> Checked:
        from cosim.provenance import provenance
        from cosim.results import prepare as prepare_folder
        from cosim.results import write_json

        scenario = _loaded(job)
        prepare_folder(job.output_dir, scenario)
        versions = provenance({"scenario": scenario.file}, job.command)
        write_json(job.output_dir / "versions.json", versions)
        return Checked(job)

    journal.call("the preparation of the folder")
    return guarded(make, partial(Checked, job))


def drive(run: Run, journal: Journal) -> RunEnd:
    """Run one controller of a scenario and write its signals; its rows outlive this process."""

    def go() -> RunEnd:
        from cosim import black_box
        from cosim.assembly import assemble
        from cosim.run import drive as drive_assembly
        from cosim.run import network_errors

        scenario = _loaded(run.checked.job)
        controller = scenario.controllers[run.number]
        with network_errors():
            assembly = assemble(scenario, controller)
        recorder = assembly.recorder
        recorder.keep_in(run.folder / black_box.NAME)
        journal.call("the run")
        outcome = drive_assembly(scenario, controller, assembly, run.folder)
        journal.call("the end of the run")
        last_s = float(recorder.time[-1]) if recorder.rows else None
        return RunEnd(run.label, outcome.figures, assembly.files, last_s=last_s)

    journal.call("the assembly of the run")
    return guarded(go, partial(_failed, run))


def _failed(run: Run, code: int, problems: tuple[str, ...]) -> RunEnd:
    """Return the end of a run that failed with words; what it has recorded is written already."""
    from cosim import black_box
    from cosim.recorder import Recorder

    box, last_s = run.folder / black_box.NAME, None
    if box.exists():
        record = Recorder.recovered(box)
        last_s = float(record.time[-1]) if record.rows else None
        box.unlink()
    several = len(run.checked.labels) > 1
    said = tuple(f"{run.label}: {words}" if several else words for words in problems)
    return RunEnd(run.label, exit_code=code, problems=said, last_s=last_s)


def conclude(conclusion: Conclusion, journal: Journal) -> Ended:
    """Judge the runs of a scenario that came to their end, and write metrics.json and the report.

    Those that did not are among the problems.
    """
    job, runs = conclusion.job, conclusion.runs
    problems = tuple(words for run in runs for words in run.problems)
    code = max(run.exit_code for run in runs)
    if all(run.figures is None for run in runs):
        return Ended(job, code, problems, runs=runs)

    def judge() -> Ended:
        from cosim.batch.conclusion import judged

        return judged(_loaded(job), job, runs, problems)

    def failed(its: int, said: tuple[str, ...]) -> Ended:
        return Ended(job, max(its, code), (*problems, *said), runs=runs)

    journal.call("the report")
    return guarded(judge, failed)


def _loaded(job: Job) -> Scenario:
    from cosim.scenario.load import load_labelled

    return load_labelled(job.scenario, job.overrides)


def guarded(work: Callable[[], E], failed: Callable[[int, tuple[str, ...]], E]) -> E:
    """Return what `work` does, or what went wrong as a result, from its exit code and sentences:
    other jobs go on.
    """
    try:
        return work()
    except (CosimError, OSError) as error:
        return failed(*explained(error))
