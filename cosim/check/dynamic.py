"""Running an FMU under trial: one child process for each trial, watched for crashes and hangs."""

from __future__ import annotations

import math
import platform
import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from cosim.check.archive import Archive
from cosim.check.binaries import binary_for
from cosim.check.description import Description
from cosim.check.finding import Finding, Report
from cosim.check.parts import Variable, number, whole
from cosim.check.schema import fmpy_folder
from cosim.check.trials.job import Answer, Channel, Job
from cosim.check.trials.perform import perform
from cosim.isolation import Children, Death, Watch

ODD_FOLDER: Final = "a b Prüfstand 道路"
STEPS: Final = 200  # of the default experiment where the XML gives no step size
# each trial, and what the FMU was doing when it failed
TRIALS: Final = {
    "default": "with its default inputs",
    "moved": "while its inputs move",
    "again": "in a second run",
    "token": "when a wrong token is offered",
    "order": "when calls come at the wrong time",
    "values": "when parameters and inputs are set",
    "state": "while a state is saved and restored",
    "serialised": "while a state goes through bytes",
    "reset": "while it is reset",
    "instances": "with two instances",
    "step-size": "with steps of other sizes",
    "stop-time": "at its stop time",
    "thread": "on another thread",
    "memory": "in one of many lives",
    "odd-path": f"in a folder called '{ODD_FOLDER}'",
}
COMPARED: Final = ("again", "thread", "reset", "instances", "state", "serialised")
_STATES: Final = {"state-not-restored", "state-call-failed"}
MODULES: Final = ("cosim.check.trials.perform",)
_UNFIT: Final = {"binary-format", "binary-architecture", "no-binary-here", "model-identifier"}


def run_trials(archive: Archive, description: Description, report: Report, timeout: float) -> None:
    """Run every trial and add what it finds. `timeout` is how long one call may take [s].

    Raises `WorkError` if a trial itself is at fault.
    """
    unfit = _UNFIT & set(report.codes)
    library = binary_for(archive, description.identifier, description.major)
    if unfit or library is None:
        reason = ", ".join(sorted(unfit)) or "no binary"
        report.not_judged.append(f"how it runs ({reason})")
        return
    with tempfile.TemporaryDirectory(prefix="cosim-check-", ignore_cleanup_errors=True) as name:
        folder = Path(name).resolve() / "fmu"
        try:
            archive.extract(folder)
        except Exception as error:  # a damaged entry has its finding; anything else is said here
            report.not_judged.append(f"how it runs (it cannot be unpacked: {error})")
            return
        (folder / "resources").mkdir(exist_ok=True)
        job = job_of(description, folder, folder / library, Path(name).resolve())
        with Children(MODULES) as children:
            _Trials(job, report, children, archive.read(library)).run(Watch(timeout))


class _Trials:
    """The sequence of trials of one FMU."""

    def __init__(self, job: Job, report: Report, children: Children, binary: bytes) -> None:
        self.job, self.report, self.children, self.binary = job, report, children, binary

    def run(self, watch: Watch) -> None:
        """Run all trials that the earlier ones leave a sense to."""
        self._watch = watch
        if self._trial("default"):
            self.report.not_judged.append("everything that needs it to run with its defaults")
            return
        if self._trial("moved"):
            self.job = replace(self.job, moving=False)
            self._trial("moved", quiet=True)
        steady = Path(self.job.reference).is_file() and not self._trial("again")
        if not steady:
            self.report.not_judged.append(f"{', '.join(COMPARED[1:])}: no run to compare with")
        for trial in TRIALS:
            if trial in ("default", "moved", "again") or (trial in COMPARED and not steady):
                continue
            if trial == "serialised" and _STATES & set(self.report.codes):
                self.report.not_judged.append("serialised: states themselves do not work")
                continue
            if trial == "odd-path":
                self._move_away()
            self._trial(trial)

    def _move_away(self) -> None:
        here = Path(self.job.resources).parent
        there = here.rename(here.with_name(ODD_FOLDER))
        library = there / Path(self.job.library).relative_to(here)
        self.job = replace(self.job, resources=str(there / "resources"), library=str(library))

    def _trial(self, trial: str, quiet: bool = False) -> bool:
        """Run one trial, add its findings; return whether the rest makes no sense."""
        answer = self.children.run(perform, replace(self.job, trial=trial), self._watch)
        if isinstance(answer, Death):
            if not quiet:
                words = f"{_words(answer)}, {TRIALS[trial]}"
                self.report.add([Finding(answer.kind, f"trial {trial}", words)])
            return True
        self.report.trials.append(trial)
        self.report.not_judged += [n for n in answer.notes if n not in self.report.not_judged]
        self.report.add(self._findings(answer))
        return answer.fatal

    def _strange_token(self, message: str) -> bool:
        """Whether the binary knows another token than the XML's."""
        if self.job.token.encode() in self.binary:
            return False
        other = re.search(rb"\{?[0-9a-fA-F]{8}(-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}", self.binary)
        return other is not None or re.search(r"guid|token", message, re.I) is not None

    def _findings(self, answer: Answer) -> Iterator[Finding]:
        known = {(f.code, f.where) for f in self.report.findings}
        for code, where, message in answer.findings:
            finding = Finding(code, where, message)
            if code == "instantiate-failed" and self._strange_token(message):
                finding = Finding(
                    "token-mismatch", where,
                    f"{message}; the XML's token, {self.job.token}, is not in the binary: they "
                    "come from different builds",
                )  # fmt: skip
            if (finding.code, finding.where) not in known:
                known.add((finding.code, finding.where))
                yield finding


def _words(death: Death) -> str:
    if death.kind == "hang":
        return f"{death.call} did not return within {death.timeout:g} s{death.said}"
    return f"it {death.manner} in {death.call}{death.said}"


# ---------------------------------------------------------------- the job


def job_of(description: Description, folder: Path, library: Path, files: Path) -> Job:
    """Return the job of an extracted FMU; `files` is where the processes leave theirs."""
    start = description.default("startTime") or 0.0
    stop, step = description.default("stopTime"), description.default("stepSize")
    simulation = description.simulation
    internal = number(simulation.get("fixedInternalStepSize"))
    stop = start + (STEPS * step if step and step > 0 else 1.0) if stop is None else stop
    if not step or not step > 0 or not math.isfinite(step):
        step = internal or (stop - start) / STEPS
    if not stop > start:
        stop = start + STEPS * (step if step > 0 else 0.01)
    step = step if step > 0 else (stop - start) / STEPS
    flags = {
        "state": "canGetAndSetFMUState", "bytes": "canSerializeFMUState",
        "once": "canBeInstantiatedOnlyOncePerProcess",
        "variable-step": "canHandleVariableCommunicationStepSize",
    }  # fmt: skip
    return Job(
        trial="default",
        major=description.major,
        library=str(library),
        resources=str(folder / "resources"),
        token=description.token,
        channels=channels(description.variables),
        categories=tuple(description.categories),
        flags=tuple(name for name, flag in flags.items() if description.flag(flag)),
        start=start,
        stop=stop,
        step=step,
        internal_step=internal,
        reference=str(files / "reference.json"),
        logger=_logger(),
    )


def channels(variables: Sequence[Variable]) -> tuple[Channel, ...]:
    """Return the variables that the trials use; locals only where there is no output."""
    public = [v for v in variables if v.causality != "local"]
    if not any(v.causality == "output" for v in variables):
        public = list(variables)[:1000]
    return tuple(
        Channel(
            v.name, v.reference, v.type, v.causality, v.variability, v.size,
            _start(v), _finite(v.minimum), _finite(v.maximum), v.nominal,
        )
        for v in public
        if v.reference is not None and v.size
    )  # fmt: skip


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _start(v: Variable) -> Any:
    if v.start is None or v.type in ("String", "Binary", "Clock"):
        return v.start
    if v.is_float:
        return number(v.start)
    if v.type == "Boolean":
        return v.start in ("true", "1")
    return whole(v.start)


def _logger() -> str:
    """Return FMPy's formatter of variadic messages for this machine, '' where it has none."""
    names = {"linux": "linux64/logging.so", "darwin": "darwin64/logging.dylib",
             "win32": "win64/logging.dll"}  # fmt: skip
    path = fmpy_folder() / "logging" / names.get(sys.platform, "none")
    x86 = platform.machine().lower() in ("x86_64", "amd64")
    return str(path) if path.is_file() and (x86 or sys.platform == "darwin") else ""
