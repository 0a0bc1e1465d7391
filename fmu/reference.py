"""The reference experiment of a model (``reference.toml``): stimuli, and what the FMU answers.

The build runs the FMU it has just made and packs the result into it, as the layered standard
FMI-LS-REF (1.0.0-alpha.1, for FMI 2.0 and 3.0) has it: a manifest, an experiments file of
MA-HS-Experiments, and the CSV and option files of the FMI Cross-Check.
"""

import hashlib
import tempfile
import tomllib
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from describe import add, document
from structure import each_corner
from table import Table
from toolchain import BuildError

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
KEYS = {"name", "description", "step_size", "stop_time", "every", "outputs", "stimuli"}
OPTIONAL = {"tolerance"}
Rows = list[list[float]]


@dataclass(frozen=True)
class Experiment:
    """A run from t = 0; stimuli as points (time s, value) of straight lines, by input."""

    name: str
    description: str
    step_size: float  # s
    stop_time: float  # s
    every: int  # steps to a row of the result
    outputs: tuple[str, ...]
    stimuli: dict[str, list[tuple[float, float]]]
    tolerance: float = 0.0  # to which processors agree, in the outputs' unit

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return round(self.stop_time / self.step_size)


def read_experiment(path: Path, table: Table) -> Experiment:
    """Read and check ``reference.toml``; raises BuildError with all problems at once."""
    raw = tomllib.loads(path.read_text(encoding="utf-8"))
    problems = [f"unknown key '{key}'" for key in sorted(set(raw) - KEYS - OPTIONAL)]
    problems += [f"no '{key}'" for key in sorted(KEYS - set(raw))]
    outputs = tuple(each_corner(raw.get("outputs", [])))
    known = {v.name for v in table.of_causality("output") if v.type == "Float64"}
    inputs = {v.name for v in table.of_causality("input") if v.type == "Float64"}
    stimuli = {n: [(float(t), float(v)) for t, v in p] for n, p in raw.get("stimuli", {}).items()}
    problems += [f"there is no output '{name}'" for name in outputs if name not in known]
    problems += [f"there is no input '{name}'" for name in sorted(set(stimuli) - inputs)]
    problems += [f"no stimulus for '{name}'" for name in sorted(inputs - set(stimuli))]
    if problems:
        raise BuildError("\n".join(f"{path}: {p}" for p in problems))
    own = {key: raw[key] for key in raw if key not in ("outputs", "stimuli")}
    return Experiment(**own, outputs=outputs, stimuli=stimuli)


def _value(points: list[tuple[float, float]], t: float) -> float:
    """Straight lines between points; rounded to 1/1024, which a CSV file holds exactly."""
    t0, y0 = max((p for p in points if p[0] <= t), default=points[0])
    t1, y1 = min((p for p in points if p[0] > t), default=points[-1])
    y = y0 if t1 <= t0 else y0 + (y1 - y0) * (t - t0) / (t1 - t0)
    return round(1024 * y) / 1024


def stimuli(experiment: Experiment) -> Rows:
    """One row to each communication point: time and inputs in the order of the experiment."""
    times = [k * experiment.step_size for k in range(experiment.steps + 1)]
    return [[t, *(_value(points, t) for points in experiment.stimuli.values())] for t in times]


def _instance(folder: Path, fmi: int) -> tuple[Any, dict[str, int]]:
    """An initialised instance of an unzipped FMU, and its value references."""
    import fmpy
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    description = fmpy.read_model_description(str(folder))
    kind = FMU2Slave if fmi == 2 else FMU3Slave
    fmu = kind(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="reference",
    )
    fmu.instantiate()
    if fmi == 2:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    return fmu, {v.name: v.valueReference for v in description.modelVariables}


def run(experiment: Experiment, folder: Path, fmi: int) -> Rows:
    """Step an unzipped FMU; one row to each `every` steps: time and outputs."""
    fmu, reference = _instance(folder, fmi)
    read, write = (fmu.getReal, fmu.setReal) if fmi == 2 else (fmu.getFloat64, fmu.setFloat64)
    inputs = [reference[name] for name in experiment.stimuli]
    outputs = [reference[name] for name in experiment.outputs]
    rows, values = [], stimuli(experiment)
    write(inputs, values[0][1:])
    fmu.exitInitializationMode()
    for k, (t, *held) in enumerate(values):
        if k % experiment.every == 0:
            rows.append([t, *read(outputs)])
        if k < experiment.steps:
            write(inputs, held)
            fmu.doStep(t, experiment.step_size)
    fmu.terminate()
    fmu.freeInstance()
    return rows


def notes(experiment: Experiment, identifier: str) -> bytes:
    """``documentation/fmi-ls-ref.txt``, which the layered standard recommends."""
    row = experiment.every * experiment.step_size
    met = f"to {experiment.tolerance:g} m/s" if experiment.tolerance else "bit for bit"
    return f"""Reference experiment '{experiment.name}': {experiment.description}.

{FOLDER}/{identifier}_in.csv has the inputs from 0 s to {experiment.stop_time} s,
one row to each communication step of {experiment.step_size} s, to be held over the step that begins
there; {identifier}_ref.csv has outputs every {row} s, as the binary gave them when it was built.
All other variables keep their start values. The step is a power of two, so that every way of
counting time gives the same numbers: the binary meets the result {met}.
""".encode()


def _csv(names: list[str], rows: Rows) -> bytes:
    lines = [",".join(["time", *names]), *(",".join(map(repr, row)) for row in rows)]
    return ("\n".join(lines) + "\n").encode()


def _experiments(experiment: Experiment, stimuli_file: str, result_file: str) -> bytes:
    """MA-HS-Experiments, of the modelica/ma-hs-experiments schema of 2026."""
    root = ET.Element("Experiments", {"name": "Smoke test"})
    element = add(root, "Experiment", name=experiment.name, description=experiment.description)
    add(
        element, "TransientSimulation",
        startTime=0.0, stopTime=experiment.stop_time, stepSize=experiment.step_size,
    )  # fmt: skip
    add(element, "Stimuli", type="text/csv", source=stimuli_file)
    add(element, "References", type="text/csv", source=result_file)
    return document(root)


def _manifest(related: list[tuple[str, str, str, str]], files: dict[str, bytes]) -> bytes:
    root = ET.Element(
        "fmiReferences",
        {
            f"{{{NAMESPACE}}}fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
            f"{{{NAMESPACE}}}fmi-ls-version": "1.0.0-alpha.1",
            f"{{{NAMESPACE}}}fmi-ls-description": "Layered Standard providing information on"
            " related files included in an FMU.",
        },
    )
    ET.register_namespace("fmi-ls", NAMESPACE)
    for name, kind, role, description in related:
        add(
            root, "Related", type=kind, source=name, role=role, description=description,
            checksum=hashlib.sha3_256(files[name]).hexdigest(), checksumType="SHA3-256",
        )  # fmt: skip
    return document(root)


def result(experiment: Experiment, contents: dict[str, bytes], fmi: int) -> Rows:
    """What an FMU of these contents answers."""
    with tempfile.TemporaryDirectory() as name:
        for path, content in contents.items():
            if path.startswith(("binaries/", "resources/", "modelDescription")):
                file = Path(name, path)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(content)
        return run(experiment, Path(name), fmi)


def reference_files(experiment: Experiment, identifier: str, rows: Rows) -> dict[str, bytes]:
    """The files of FMI-LS-REF by their path in the FMU, with the result's rows."""
    stem, h = identifier, experiment.step_size
    files = {
        f"{stem}_in.csv": _csv(list(experiment.stimuli), stimuli(experiment)),
        f"{stem}_ref.csv": _csv(list(experiment.outputs), rows),
        f"{stem}_ref.opt": f"StartTime, 0.0\nStopTime, {experiment.stop_time}\nStepSize, {h}\n"
        "RelTol, 0.0\n".encode(),
        f"{stem}.exp": _experiments(experiment, f"{stem}_in.csv", f"{stem}_ref.csv"),
    }
    what = experiment.name
    related = [
        (f"{stem}.exp", "application/x-ma-hs-experiments", "experiment/smoke-test",
         experiment.description),
        (f"{stem}_in.csv", "text/csv", "testcase", f"Inputs of '{what}', one row to each step"),
        (f"{stem}_ref.csv", "text/csv", "result", f"Outputs of '{what}'"),
        (f"{stem}_ref.opt", "text/plain", "other", "Options of the FMI Cross-Check"),
    ]  # fmt: skip
    files["fmi-ls-manifest.xml"] = _manifest(related, files)
    return {f"{FOLDER}/{name}": content for name, content in files.items()}
