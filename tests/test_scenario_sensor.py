"""A scenario's sensor: its estimator and measurement condition, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from foreign_fmu import own_variables, parrot
from loop_rig import Guess, write_scenario

from cosim.assembly import Assembly, assemble
from cosim.cli import main
from cosim.errors import InputError
from cosim.run import execute
from cosim.scenario.load import load
from sensor.channels import STAGE
from sensor.conditions import Condition, Measurement
from sensor.estimators import make

BUMPS = "{kind: bumps, height_m: 0.02, length_m: 0.5, spacing_m: 5}"


def problems(folder: Path, sensor: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        load(write_scenario(folder, sections={"sensor": sensor}))
    return [problem.message for problem in caught.value.problems]


def run(folder: Path, sensor: str, *overrides: str, **sections: str) -> Any:
    path = write_scenario(
        folder, duration="2", obstacles=BUMPS, sections={"sensor": sensor, **sections}
    )
    return execute(load(path, overrides), folder / "out")


def test_the_default_is_the_project_s_best() -> None:
    scenario = load(Path(__file__).parents[1] / "scenarios" / "road" / "class_b_50.yaml")
    settings = scenario.sensor
    assert (settings.estimator, settings.network, settings.condition) == (
        "carried", None, "ideal",
    )  # fmt: skip


def test_a_wrong_name_gets_the_nearest_right_one(tmp_path: Path) -> None:
    message = problems(tmp_path, "{estimator: fir_w46}")[0]
    assert message.startswith("sensor.estimator must be zero, body_motion, ")
    assert message.endswith("not 'fir_w46'; did you mean 'fir_w64'?")
    message = problems(tmp_path, "{condition: prodction}")[0]
    assert message.endswith("not 'prodction'; did you mean 'production'?")
    assert "'estimatr' is not a field of sensor" in problems(tmp_path, "{estimatr: zero}")[0]


def test_an_estimator_or_a_file_not_several(tmp_path: Path) -> None:
    several = ("{estimator: zero, network: n.onnx}", "{network: n.onnx, fmu: s.fmu}")
    for wrong in (*several, "{estimator: zero, fmu: s.fmu}", "{estimator: }"):
        said = " ".join(problems(tmp_path, wrong))
        assert "give either an estimator, a network or an FMU" in said
    for gone in ("{network: gone.onnx}", "{fmu: gone.fmu}"):
        found = problems(tmp_path, gone)
        assert len(found) == 1
        assert "there is no file" in found[0]
    assert "must be a sensor FMU (.fmu), not 'n.onnx'" in problems(tmp_path, "{fmu: n.onnx}")[0]


def test_a_network_takes_the_estimator_s_place(tmp_path: Path) -> None:
    (tmp_path / "n.onnx").write_bytes(b"")
    scenario = load(write_scenario(tmp_path, sections={"sensor": "{network: n.onnx}"}))
    assert (scenario.sensor.estimator, scenario.sensor.network) == (None, "n.onnx")


def test_an_estimator_that_is_not_shipped_ends_with_3(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sensor.estimators.MODELS", tmp_path)
    path = write_scenario(tmp_path, sections={"sensor": "{estimator: fir_w64}"})
    result = CliRunner().invoke(main, ["run", str(path), "--output-dir", str(tmp_path / "out")])
    assert result.exit_code == 3
    assert "fir_w64_ideal.npz: estimator 'fir_w64' is not shipped" in result.stderr
    assert "Traceback" not in result.output


@pytest.mark.parametrize("condition", ["ideal", "production"])
def test_the_sensor_in_the_loop_is_the_estimator_on_the_record(
    tmp_path: Path, condition: str
) -> None:
    outcome = run(tmp_path, f"{{estimator: body_motion, condition: {condition}}}")
    record = outcome.runs[0].recorder
    expected = make("body_motion", "ideal").apply(record.group("channels"), np.zeros((201, 4)))
    np.testing.assert_allclose(record.group("estimate"), expected, rtol=0.0, atol=1e-12)
    figures = outcome.runs[0].figures
    assert figures["sensor"] == figures["body_motion"]
    known: Condition = "ideal" if condition == "ideal" else "production"
    linear = make("fir_w19", known).apply(record.group("channels"), np.zeros((201, 4)))
    counted = np.isfinite(linear).all(axis=1)
    error = (linear - record.group("truth"))[counted]
    found = figures["fir"]["overall"]["rmse_m_s"]
    assert found == pytest.approx(np.sqrt(np.mean(np.square(error))))
    assert outcome.metrics["sensor"] == {"estimator": "body_motion", "condition": condition}


def test_production_is_measured_from_the_vehicle_s_own_sensors(tmp_path: Path) -> None:
    """Sensor, controller and record get the measured channels; truth and motion stay the same."""
    (tmp_path / "a").mkdir()
    exact = run(tmp_path / "a", "{estimator: zero}").runs[0].recorder
    outcome = run(tmp_path, "{estimator: zero, condition: production}", "seed=5")
    measured = outcome.runs[0].recorder
    np.testing.assert_array_equal(exact.group("truth"), measured.group("truth"))
    np.testing.assert_array_equal(exact.group("channels"), measured.group("ideal"))
    assert not exact.group("ideal").size
    stage = measured.columns([signal.name for signal in STAGE])
    expected = Measurement("production", 5).apply(measured.group("ideal"), stage)
    np.testing.assert_array_equal(measured.group("channels"), expected)
    header = (tmp_path / "out" / "signals.csv").read_text().splitlines()[0]
    assert header.endswith("Ideal.Steer.WhlAng [rad]")


def test_the_seed_decides_what_is_measured(tmp_path: Path) -> None:
    records = [
        run(tmp_path, "{estimator: zero, condition: production}", f"seed={seed}").runs[0].recorder
        for seed in (1, 1, 2)
    ]
    one, same, other = (record.group("channels") for record in records)
    np.testing.assert_array_equal(one, same)
    assert (one != other).any(axis=0).all()


def test_manoeuvre_figures_tell_of_the_true_motion(tmp_path: Path) -> None:
    """A yaw rate that is a degree per second off would spoil them."""
    manoeuvre = {"manoeuvre": "{kind: constant_speed}", "road": "{track: straight, length_m: 60}"}
    figures = []
    for condition in ("ideal", "production"):
        sections = {"sensor": f"{{estimator: zero, condition: {condition}}}", **manoeuvre}
        path = write_scenario(tmp_path, duration="lap", sections=sections)
        figures.append(execute(load(path), tmp_path / "out").runs[0].figures["manoeuvre"])
    assert figures[0] == figures[1]


def test_a_vehicle_without_sensor_signals_is_named(tmp_path: Path) -> None:
    variables = own_variables()
    parrot(tmp_path / "p.fmu", tuple(v for n, v in variables.items() if "Sensor." not in n))
    sections = {"vehicle": "{fmu: p.fmu}", "sensor": "{condition: production}"}
    scenario = load(write_scenario(tmp_path, sections=sections))
    with pytest.raises(InputError, match=r"'p\.fmu' has no Sensor\.Imu\.ax") as caught:
        assemble(scenario, scenario.controllers[0])
    assert caught.value.problems[0].place.line > 0
    built: Assembly = assemble(
        load(scenario.file, ["sensor.condition=ideal"]), scenario.controllers[0], Guess()
    )
    built.blocks.vehicle.stop()


def test_inspect_shows_the_sensor(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, sections={"sensor": "{estimator: fir_w19}"})
    result = CliRunner().invoke(main, ["inspect", str(path)])
    assert result.exit_code == 0, result.output
    assert "sensor.estimator" in result.stdout
    assert "fir_w19_ideal.npz" in result.stdout
    assert "sensor.condition" in result.stdout
