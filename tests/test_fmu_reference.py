"""The reference experiments in the FMUs (FMI-LS-REF), replayed by another master."""

from __future__ import annotations

import hashlib
import io
from pathlib import Path

import fmpy
import numpy as np
import pytest
import shipped_fmus as fmus
from fmpy.util import read_csv, read_ref_opt_file
from fmu_face import ROOT, reference, toolchain, variables

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
LS = "{http://fmi-standard.org/fmi-ls-manifest}fmi-ls-"
ROLES = {"experiment/smoke-test", "testcase", "result", "other"}

every = pytest.mark.parametrize("fmu", fmus.ALL, ids=str)


def table(fmu: fmus.Shipped, name: str) -> np.ndarray:
    """A CSV file by column."""
    text = io.StringIO(fmus.entry(fmu, f"{FOLDER}/{name}").decode())
    names = text.readline().strip().split(",")
    rows = [tuple(map(float, line.split(","))) for line in text]
    return np.array(rows, dtype=[(n, float) for n in names])


def experiment(fmu: fmus.Shipped) -> tuple[dict[str, float], str, str]:
    """Times, stimuli and reference file of the one experiment."""
    root = fmus.xml(fmu, f"{FOLDER}/{fmu.identifier}.exp")
    (element,) = root.findall("Experiment")
    assert root.get("name")
    assert element.get("name")
    transient, inputs, outputs = element
    assert [e.tag for e in element] == ["TransientSimulation", "Stimuli", "References"]
    times = {key: float(value) for key, value in transient.items()}
    return times, str(inputs.get("source")), str(outputs.get("source"))


@every
def test_the_manifest_lists_every_file_with_its_checksum(fmu: fmus.Shipped) -> None:
    root = fmus.xml(fmu, f"{FOLDER}/fmi-ls-manifest.xml")
    assert root.tag == "fmiReferences"
    assert root.get(f"{LS}name") == "org.fmi-standard.fmi-ls-ref"
    assert root.get(f"{LS}version") == "1.0.0-alpha.1"
    assert root.get(f"{LS}description") == (
        "Layered Standard providing information on related files included in an FMU."
    )
    present = {n.rpartition("/")[2] for n in fmus.names(fmu) if n.startswith(FOLDER)}
    assert {str(r.get("source")) for r in root} == present - {"fmi-ls-manifest.xml"}
    for related in root:
        content = fmus.entry(fmu, f"{FOLDER}/{related.get('source')}")
        assert related.get("checksumType") == "SHA3-256"
        assert related.get("checksum") == hashlib.sha3_256(content).hexdigest()
        assert related.get("role") in ROLES
        assert related.get("type")
        assert related.get("description")
    assert "documentation/fmi-ls-ref.txt" in fmus.names(fmu)


@every
def test_another_master_meets_the_result_bit_for_bit(fmu: fmus.Shipped) -> None:
    """A sensor's result was made by this machine when it was packed: no rounding in between."""
    times, inputs, outputs = experiment(fmu)
    expected = table(fmu, outputs)
    names = expected.dtype.names
    assert names is not None
    result = fmpy.simulate_fmu(
        str(fmu.path), input=table(fmu, inputs), output=list(names[1:]),
        start_time=times["startTime"], stop_time=times["stopTime"],
        output_interval=times["stepSize"],
    )  # fmt: skip
    every = (len(result) - 1) // (len(expected) - 1)
    assert len(expected) == (65 if fmu.model == "vehicle" else 33)
    np.testing.assert_array_equal(result[::every], expected)


@every
def test_the_experiment_is_a_drive(fmu: fmus.Shipped) -> None:
    _, inputs, outputs = experiment(fmu)
    driven = table(fmu, outputs)
    assert set(table(fmu, inputs).dtype.names or ()) == {"time"} | {
        v.name for v in fmus.variables(fmu).values() if v.causality == "input"
    }
    assert driven["time"].tolist() == [k / 16 for k in range(len(driven))]
    if fmu.model != "vehicle":
        assert np.ptp(driven["VRel.FL"]) > 0.01
        return
    assert driven["Car.vx"].max() > 10.0
    assert np.abs(driven["Car.ay"]).max() > 1.0
    assert driven["Car.ax"].min() < -3.0
    assert np.abs(driven["Car.CFL.q0p"]).max() > 0.01


@every
def test_both_versions_have_one_result(fmu: fmus.Shipped) -> None:
    for name in (f"{fmu.identifier}_in.csv", f"{fmu.identifier}_ref.csv"):
        other = fmus.Shipped(fmu.model, 2)
        assert fmus.entry(fmu, f"{FOLDER}/{name}") == fmus.entry(other, f"{FOLDER}/{name}")


@every
def test_the_files_are_those_of_the_cross_check(fmu: fmus.Shipped, tmp_path: Path) -> None:
    stem = fmu.identifier
    for name in (f"{stem}_in.csv", f"{stem}_ref.csv", f"{stem}_ref.opt"):
        (tmp_path / name).write_bytes(fmus.entry(fmu, f"{FOLDER}/{name}"))
    options = read_ref_opt_file(tmp_path / f"{stem}_ref.opt")
    times, _, _ = experiment(fmu)
    assert (options["StopTime"], options["StepSize"]) == (times["stopTime"], times["stepSize"])
    np.testing.assert_array_equal(
        read_csv(tmp_path / f"{stem}_ref.csv"), table(fmu, f"{stem}_ref.csv")
    )


def test_mistakes_in_an_experiment_are_named_all_at_once(tmp_path: Path) -> None:
    table = variables.read_table(ROOT / "fmu" / "vehicle" / "variables.toml")
    text = (ROOT / "fmu" / "vehicle" / "reference.toml").read_text(encoding="utf-8")
    text = text.replace('"DM.Gas"', '"DM.Gaz"').replace("every = 8", "evry = 8")
    (tmp_path / "reference.toml").write_text(text.replace('"Car.ax"', '"Car.axe"'))
    with pytest.raises(toolchain.BuildError) as caught:
        reference.read_experiment(tmp_path / "reference.toml", table)
    said = str(caught.value).splitlines()
    assert [line.split(": ")[-1] for line in said] == [
        "unknown key 'evry'", "no 'every'", "there is no output 'Car.axe'",
        "there is no input 'DM.Gaz'", "no stimulus for 'DM.Gas'",
    ]  # fmt: skip
