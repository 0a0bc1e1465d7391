"""The controllers of a scenario: names of their runs, estimators of their own, mistakes in them."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from loop_rig import write_scenario

from cosim.errors import InputError
from cosim.run import execute
from cosim.scenario.controllers import Controller, Law
from cosim.scenario.load import load
from sensor.estimators import MODELS, make

FIELD = re.compile(r"`(\w+)`(?: \(([\d.]+)\))?")
BUMPS = "{kind: bumps, height_m: 0.02, length_m: 0.5, spacing_m: 5}"


def scenario(folder: Path, controllers: str, **fields: str) -> Path:
    sections = {"controllers": controllers, **fields}
    return write_scenario(folder, duration="2", obstacles=BUMPS, sections=sections)


def problems(folder: Path, controllers: str) -> str:
    with pytest.raises(InputError) as caught:
        load(scenario(folder, controllers))
    return str(caught.value)


@pytest.mark.parametrize(
    ("controller", "label"),
    [
        ("{kind: passive}", "passive"),
        ("{kind: passive, estimator: kalman}", "passive_kalman"),
        ("{kind: fixed, command: 0.5}", "fixed"),
        ("{kind: fixed, command: 1, name: hard}", "hard"),
        ("{kind: skyhook}", "skyhook_estimate"),
        ("{kind: skyhook, estimator: zero}", "skyhook_zero"),
        ("{kind: skyhook, feedback: truth, estimator: zero}", "skyhook_truth"),
    ],
)
def test_what_a_run_is_called_also_in_a_limit(tmp_path: Path, controller: str, label: str) -> None:
    limits = f"[{{metric: {label}.valid_samples, min: 0}}]"
    loaded = load(scenario(tmp_path, f"[{controller}]", limits=limits))
    assert loaded.controllers[0].label == label


def test_each_run_has_its_own_estimator(tmp_path: Path) -> None:
    """What is recorded is what that estimator says of the recorded channels."""
    shutil.copy(MODELS / "bilstm_w19_ideal.onnx", tmp_path / "own.onnx")
    controllers = (
        "[{kind: passive}, {kind: fixed, command: 0.4, estimator: kalman},"
        " {kind: skyhook, estimator: fir_w19}, {kind: skyhook, network: own.onnx}]"
    )
    path = scenario(tmp_path, controllers, sensor="{estimator: body_motion}")
    outcome = execute(load(path), tmp_path / "out")
    names = ("body_motion", "kalman", "fir_w19", "bilstm_w19")
    for run, name in zip(outcome.runs, names, strict=True):
        record = run.recorder
        commands = record.group("command")
        held = np.vstack([np.zeros(4) if "skyhook" in run.label else commands[:1], commands[:-1]])
        expected = make(name, "ideal").apply(record.group("channels"), held)
        rows = record.group("valid")[:, 0] > 0
        assert rows.sum() > 150
        np.testing.assert_allclose(record.group("estimate")[rows], expected[rows], atol=2e-5)
    files = json.loads((tmp_path / "out" / "versions.json").read_text())["files"]
    own = ("sensor", "sensor skyhook_fir_w19", "sensor skyhook_estimate")
    assert {*own, "fmu", "road", "scenario"} <= files.keys()
    assert Path(files["sensor skyhook_estimate"]["path"]).name == "own.onnx"


def test_an_estimator_of_a_run_is_checked_like_the_scenarios(tmp_path: Path) -> None:
    found = problems(tmp_path, "[{kind: skyhook, estimator: kalmn}]")
    assert "controllers.0.estimator must be" in found
    assert "did you mean 'kalman'?" in found
    found = problems(tmp_path, "[{kind: passive}, {kind: skyhook, network: gone.onnx}]")
    assert "controllers.1.network: there is no file" in found
    both = "[{kind: skyhook, estimator: zero, network: gone.onnx}]"
    assert "give either an estimator, a network or an FMU" in problems(tmp_path, both)


def test_two_runs_of_one_name_need_names(tmp_path: Path) -> None:
    twice = "[{kind: fixed, command: 0}, {kind: fixed, command: 1}]"
    assert "two runs are called 'fixed'; give one a name" in problems(tmp_path, twice)


def test_a_fixed_command_lies_between_soft_and_hard(tmp_path: Path) -> None:
    found = problems(tmp_path, "[{kind: fixed, command: 1.5}, {kind: fixed}]")
    assert "controllers.0.command must be at most 1, not 1.5" in found
    assert "controllers.1 has no command, which it needs" in found


def test_the_resolved_scenario_runs_again(tmp_path: Path) -> None:
    path = scenario(tmp_path, "[{kind: fixed, command: 0.4, estimator: zero}]")
    execute(load(path), tmp_path / "out")
    again = load(tmp_path / "out" / "scenario.resolved.yaml")
    assert again.controllers == load(path).controllers


def test_the_page_has_every_kind_with_its_fields_and_defaults() -> None:
    page = (Path(__file__).parents[1] / "docs" / "scenarios.md").read_text()
    section = page.partition("\n## Controllers\n")[2].partition("\n## ")[0]
    rows = [line.split(" | ") for line in section.splitlines() if line.startswith("| `")]
    told = {row[0].strip("| `"): dict(FIELD.findall(row[2])) for row in rows}
    kinds = {
        get_args(model.model_fields["kind"].annotation)[0]: model.model_fields
        for model in get_args(get_args(Controller)[0])
    }
    assert told.keys() == kinds.keys()
    for kind, fields in kinds.items():
        assert told[kind].keys() == fields.keys() - Law.model_fields.keys() - {"kind"}
        for name, default in told[kind].items():
            assert not default or float(default) == fields[name].default
