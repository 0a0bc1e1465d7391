"""`execute`: one scenario from its settings to its results, once per controller.

The results of a run are the signals, metrics.json, scenario.resolved.yaml, versions.json and
report.html. Whatever was recorded before a failure is written before the failure is passed on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from cosim.errors import NetworkError
from cosim.limits import counted, evaluate, run_of
from cosim.recorder import Recorder
from cosim.results import finite, folder_of, prepare, write_json
from cosim.scenario.controllers import Controller
from cosim.scenario.paper_row import row_of
from cosim.scenario.schema import Scenario
from cosim.verdict import Verdict

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

Progress = Callable[[str, int, int], None]


class RunResult(Protocol):
    """How one run ended."""

    @property
    def steps_done(self) -> int:
        """Number of sample steps taken."""

    @property
    def wall_time_s(self) -> float:
        """Time that the loop took [s]."""

    @property
    def simulated_s(self) -> float:
        """Simulated time [s]."""

    @property
    def lap_time_s(self) -> float | None:
        """Time at the end of the road [s], None when it was not reached."""

    @property
    def finish_reason(self) -> str:
        """Why the run ended, in a few words."""

    @property
    def largest_deviation_m(self) -> float:
        """Largest distance from the road's reference line [m]."""

    @property
    def comfort(self) -> Mapping[str, Any]:
        """Figures by name, at least those of `cosim.metrics.COMFORT_FIGURES`."""

    @property
    def manoeuvre(self) -> Mapping[str, Any]:
        """Figures of `cosim.metrics.MANOEUVRE_FIGURES` by name; empty without a manoeuvre."""

    @property
    def grip(self) -> Mapping[str, Any]:
        """Figures of `cosim.metrics.GRIP_FIGURES` by wheel; empty where the vehicle has none."""

    @property
    def timing(self) -> Mapping[str, Any]:
        """What the machine took: `cosim.metrics.STEP_TIMES`, in real time `LATENESS` too."""

    @property
    def bus(self) -> Mapping[str, Any]:
        """Figures of `cosim.metrics.BUS_FIGURES` by name; empty without a bus."""


class Assembly(Protocol):
    """The blocks of one run, connected and ready."""

    @property
    def recorder(self) -> Recorder:
        """The record that the run fills."""

    @property
    def initial_command(self) -> npt.NDArray[np.float64]:
        """Damper commands before the first sample, (4,)."""

    @property
    def files(self) -> Mapping[str, Path]:
        """Files that decide the result, such as `fmu`, `sensor` and `road`, to be hashed."""

    def run(self, progress: Callable[[int, int], None] | None) -> RunResult:
        """Run to the end; `progress` is told steps done and steps at most."""


Assemble = Callable[[Scenario, Controller], Assembly]


# Further verdicts on a scenario's records, by the names of the runs.
Judge = Callable[[Scenario, Mapping[str, Recorder]], Sequence[Verdict]]


@dataclass(frozen=True)
class RunOutcome:
    """One run: the name of its controller, the record and the figures of metrics.json."""

    label: str
    recorder: Recorder
    figures: dict[str, Any]


@dataclass(frozen=True)
class Outcome:
    """What `execute` leaves: the runs, the verdicts and where everything was written."""

    scenario: Scenario
    output_dir: Path
    runs: tuple[RunOutcome, ...]
    verdicts: tuple[Verdict, ...]
    metrics: dict[str, Any]
    notes: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether every limit holds."""
        return all(verdict.passed for verdict in self.verdicts)

    @property
    def exit_code(self) -> int:
        """0 when every limit holds, else 1."""
        return 0 if self.passed else 1

    def sensor_of(self, label: str) -> dict[str, Any]:
        """Return the settings of the sensor in one run: the scenario's, or its controller's own."""
        controller = next(one for one in self.scenario.controllers if one.label == label)
        settings = controller.sensor_of_run(self.scenario.sensor)
        return settings.model_dump(mode="json", exclude_none=True)


def execute(
    scenario: Scenario,
    output_dir: Path,
    progress: Progress | None = None,
    assemble: Assemble | None = None,
    command: str = "",
) -> Outcome:
    """Run the scenario once per controller, write the results and return them.

    `command` is the command line that the report shows; `assemble` connects the blocks of a run
    (default: `cosim.assembly.assemble`). Raises `InputError` for what a user can mend, `FmuError`
    or `NetworkError` for a block that fails; rows recorded until then, and the figures of the runs
    that have ended, are written first.
    """
    from cosim.provenance import add_files, provenance

    assemble = assemble or _assemble()
    prepare(output_dir, scenario)
    runs: list[RunOutcome] = []
    versions: dict[str, Any] = {}
    try:
        for controller in scenario.controllers:
            with network_errors():
                assembly = assemble(scenario, controller)
            if not versions:
                versions = provenance({"scenario": scenario.file}, command)
            add_files(versions, assembly.files, controller.label)
            write_json(output_dir / "versions.json", versions)
            folder = folder_of(scenario, output_dir, controller.label)
            runs.append(drive(scenario, controller, assembly, folder, progress))
    except BaseException:
        if runs:  # an interrupt or a failure does not take their figures with it
            conclude(scenario, output_dir, runs, versions)
        raise
    return conclude(scenario, output_dir, runs, versions)


@contextmanager
def network_errors() -> Iterator[None]:
    """Turn the sensor's own exception into one of this package's."""
    from sensor import SensorError

    try:
        yield
    except SensorError as error:
        raise NetworkError(str(error)) from error


def _assemble() -> Assemble:
    from cosim.assembly import assemble

    return assemble


def drive(
    scenario: Scenario,
    controller: Controller,
    assembly: Assembly,
    folder: Path,
    progress: Progress | None = None,
) -> RunOutcome:
    """Run one controller's assembly to its end, write its signals to `folder` and return its
    figures; after an error the rows before it are written.
    """
    from cosim.compare import compare
    from cosim.control.damper_map import damper_map
    from cosim.control.figures import control_figures
    from cosim.faults.figures import fault_figures

    label, latency = controller.label, controller.latency_of_run(scenario.latency)

    def tell(done: int, total: int) -> None:
        if progress is not None:
            progress(label, done, total)

    try:
        with network_errors():
            result = assembly.run(tell)
    finally:
        # Also after an error: the rows before it are what shows its cause.
        if assembly.recorder.rows:
            assembly.recorder.write(folder, scenario.output.format)
    tell(result.steps_done, result.steps_done)
    figures = {
        "controller": controller.model_dump(mode="json", exclude_none=True),
        "finish_reason": result.finish_reason,
        "lap_time_s": result.lap_time_s,
        "simulated_s": result.simulated_s,
        "wall_time_s": result.wall_time_s,
        "largest_deviation_m": result.largest_deviation_m,
        "real_time_factor": result.simulated_s / max(result.wall_time_s, 1e-9),
        **compare(assembly.recorder, assembly.initial_command, scenario.sensor.condition),
        "faults": fault_figures(scenario.acting_faults, assembly.recorder),
        "comfort": dict(result.comfort),
        **control_figures(controller, assembly.recorder, damper_map(scenario.parameters), latency),
        "manoeuvre": dict(result.manoeuvre),
        "grip": dict(result.grip),
        "timing": dict(result.timing),
        "bus": dict(result.bus),
    }
    return RunOutcome(label, assembly.recorder, figures)


def conclude(
    scenario: Scenario,
    output_dir: Path,
    runs: Sequence[RunOutcome],
    versions: Mapping[str, Any],
    judge: Judge | None = None,
) -> Outcome:
    """Judge the runs that have ended, all or some of a scenario's, by its limits and by `judge`,
    and write metrics.json and the report.
    """
    from cosim.compare import paper_figures
    from cosim.control.against_truth import against_truth
    from cosim.control.figures import blind

    figures = {run.label: run.figures for run in runs}
    ended = [controller for controller in scenario.controllers if controller.label in figures]
    for label, found in against_truth(ended, figures).items():
        figures[label]["against_truth"] = found
    records = {run.label: run.recorder for run in runs}
    limits, notes = counted(scenario.limits, scenario.road.surface_name, scenario.real_time)
    missing = {controller.label for controller in scenario.controllers} - set(figures)
    limits = [limit for limit in limits if run_of(limit) not in missing]
    verdicts = (
        *evaluate(limits, figures, records),
        *_unfinished(scenario, figures),
        *(judge(scenario, records) if judge is not None else ()),
    )
    metrics = finite(
        {
            "scenario": scenario.name,
            "sensor": scenario.sensor.model_dump(mode="json", exclude_none=True),
            "runs": figures,
            "limits": [asdict(verdict) for verdict in verdicts],
            "paper": paper_figures(row_of(scenario)),
        }
    )
    write_json(output_dir / "metrics.json", metrics)
    notes = (*notes, *_idle(scenario, runs), *blind(ended, records))
    outcome = Outcome(scenario, output_dir, tuple(runs), verdicts, metrics, notes)
    return _report(outcome, versions)


def _idle(scenario: Scenario, runs: Sequence[RunOutcome]) -> tuple[str, ...]:
    """Return a note on each fault that no run was long enough for."""
    from cosim.faults.shown import idle

    longest = max((run.recorder for run in runs), key=lambda recorder: recorder.rows)
    return tuple(idle(scenario.acting_faults, longest.rows, longest.step_s))


def _unfinished(scenario: Scenario, figures: Mapping[str, Any]) -> list[Verdict]:
    """Return a failure for each run that an overrun stopped, and for each lap that did not come to
    its end, whatever the limits are.
    """
    failed = []
    stops = scenario.real_time is not None and scenario.real_time.overrun == "stop"
    for label, run in figures.items():
        overruns = run["timing"].get("overruns")
        if stops and overruns:
            failed.append(Verdict(label, "timing.overruns", overruns, None, 0.0, False))
        elif scenario.duration == "lap" and run["lap_time_s"] is None:
            failed.append(Verdict(label, "lap_time_s", None, 0.0, None, False))
    return failed


def _report(outcome: Outcome, versions: Mapping[str, Any]) -> Outcome:
    from dataclasses import replace

    from cosim.report import ReportError, write_report

    try:
        write_report(outcome, versions, outcome.output_dir / "report.html")
    except ReportError as missing:
        return replace(outcome, notes=(*outcome.notes, str(missing)))
    return outcome
