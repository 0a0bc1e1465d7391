"""Faults in a scenario: what is refused and in which words, and what a run with them leaves."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from click.testing import CliRunner
from loop_rig import Guess, write_scenario

from cosim.assembly import assemble
from cosim.cli import main
from cosim.dataset.drive import run_of
from cosim.errors import InputError
from cosim.results import resolved_yaml
from cosim.run import execute
from cosim.scenario.load import load
from cosim.scenario.schema import json_schema
from sensor.channels import CHANNEL_NAMES

BUMPS = "{kind: bumps, height_m: 0.02, length_m: 0.5, spacing_m: 5}"


def problems(folder: Path, faults: str, **sections: str) -> list[str]:
    with pytest.raises(InputError) as caught:
        load(write_scenario(folder, sections={"faults": faults, **sections}))
    assert all(problem.place and problem.place.line for problem in caught.value.problems)
    return [problem.message for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("{kind: bais, channels: imu, value: 1}",
         "faults.0.kind must be bias, delay, drift, dropout, gain, jitter, noise, osp_scenario, "
         "quantisation, saturation, spikes, stuck or swapped_wheels, not 'bais'; did you mean "
         "'bias'?"),
        ("{kind: gain, channels: Car.azz, factor: 2}",
         "faults.0.channels: 'Car.azz' is no channel and no group of channels; did you mean "
         "'Car.az'?"),
        ("{kind: gain, channels: [imu, wheelspeeds], factor: 2}",
         "faults.0.channels: 'wheelspeeds' is no channel and no group of channels; did you mean "
         "'wheel_speeds'?"),
        ("{kind: gain, channels: [], factor: 2}",
         "faults.0.channels must be a channel, a group of channels, or a list of them, not a list"),
        ("{kind: gain, channels: imu, factor: 2, start_s: 5, end_s: 4}",
         "faults.0.end_s must be after start_s, which is 5 s, not 4"),
        ("{kind: gain, channels: imu, factor: 2, start_s: 5, end_s: 5}",
         "faults.0.end_s must be after start_s, which is 5 s, not 5"),
        ("{kind: gain, channels: imu, factor: 2, start_s: 1, end_s: 3, ramp_s: 1.5}",
         "faults.0.ramp_s must be at most half the time from start_s to end_s, 1 s, not 1.5"),
        ("{kind: gain, channels: imu, factor: 2, start_s: -1}",
         "faults.0.start_s must be at least 0 s, not -1 s"),
        ("{kind: bias, channels: Car.az, value: 3 deg/s}",
         "faults.0.value: 'deg/s' is no unit for m/s2; write it as in '0.5 m/s2'"),
        ("{kind: drift, channels: angular_rates, rate: 3 deg/s}",
         "faults.0.rate: 'deg/s' is no unit for rad/s/s; write it as in '2 deg/s/min'"),
        ("{kind: bias, channels: imu, value: 1}",
         "faults.0.value: cannot be one value for channels in m/s2 and rad/s; give a fault for "
         "each"),
        ("{kind: noise, channels: Car.az, rms: much}",
         "faults.0.rms must be a finite number, in the channels' SI unit or followed by its unit "
         "as in '2 deg/s', not 'much'"),
        ("{kind: noise, channels: Car.az, rms: 0}", "faults.0.rms must be greater than 0, not 0"),
        ("{kind: noise, channels: Car.az}", "faults.0 has no rms, which it needs"),
        ("{kind: noise, channels: Car.az, rsm: 1}", "faults.0 has no rms, which it needs"),
        ("{kind: stuck, channels: Car.az, ramp_s: 1}",
         "'ramp_s' is not a field of faults.0, which has "),
        ("{kind: saturation, channels: Car.az}", "faults.0: a saturation needs min, max or both"),
        ("{kind: saturation, channels: Car.az, min: 2, max: 1}",
         "faults.0: min must be less than max"),
        ("{kind: delay, channels: all, delay_ms: 2000}",
         "faults.0.delay_ms must be at most 1000 ms, not 2000 ms"),
        ("{kind: dropout, channels: all, fill: zero}",
         "faults.0.fill must be hold or nan, not 'zero'"),
        ("{kind: dropout, channels: all, fill: nan, share: 0.9, outage_s: 0.05}",
         "faults.0.outage_s must be at least 0.09 s where a share of 0.9 is missing, not 0.05"),
        ("{kind: swapped_wheels, wheels: [FL, FL]}",
         "faults.0.wheels must be two different wheels, not a list"),
        ("{kind: spikes, channels: Car.az, height: 1, rate_hz: 200}",
         "faults.0.rate_hz must be at most 100 Hz, not 200 Hz"),
    ],
)  # fmt: skip
def test_a_mistake_is_named_in_one_sentence(tmp_path: Path, fault: str, message: str) -> None:
    found = problems(tmp_path, f"[{fault}]")
    assert any(one.startswith(message) for one in found), found
    assert len(found) <= 2


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    faults = "[{kind: noise, channels: Car.vxx, rms: 1}, {kind: gain, channels: all, factor: nan}]"
    found = problems(tmp_path, faults, latency="{sensor_ms: 5, damper_ms: -10}")
    assert len(found) == 4
    assert "latency.sensor_ms must be a multiple of 10 ms, the time of a sample, not 5" in found
    assert "latency.damper_ms must be at least 0 ms, not -10 ms" in found


def test_two_faults_of_one_kind_are_numbered_and_names_stay_apart(tmp_path: Path) -> None:
    one = "{kind: gain, channels: imu, factor: 2}"
    scenario = load(write_scenario(tmp_path, sections={"faults": f"[{one}, {one}]"}))
    assert [entry.label for entry in scenario.acting_faults] == ["gain", "gain_2"]
    named = "{kind: gain, name: gain_2, channels: imu, factor: 2}"
    found = problems(tmp_path, f"[{named}, {one}, {one}]")
    assert found == ["faults: two faults are called 'gain_2'; give one a name"]


def test_values_are_resolved_to_the_channels_unit(tmp_path: Path) -> None:
    faults = "[{kind: noise, channels: Car.vx, rms: 3.6 km/h}, {kind: stuck, channels: Car.ax}]"
    scenario = load(write_scenario(tmp_path, sections={"faults": faults}))
    (tmp_path / "again.yaml").write_text(resolved_yaml(scenario))
    again = load(tmp_path / "again.yaml")
    assert again.faults == scenario.faults
    assert again.faults[0].model_dump()["rms"] == pytest.approx(1.0, rel=1e-12)


def test_the_schema_takes_what_the_program_takes(tmp_path: Path) -> None:
    good: list[Any] = [
        {"kind": "noise", "channels": ["imu", "Car.vx"], "rms": 1, "seed": 3},
        {"kind": "drift", "channels": "Car.az", "rate": "1 m/s2/min", "end_s": 4},
        {"kind": "saturation", "channels": "Car.az", "max": "1 g"},
        {"kind": "swapped_wheels", "wheels": ["FL", "RR"]},
        {"kind": "osp_scenario", "file": "a.json", "variables": {"Car.az": {"name": "realOut"}}},
    ]
    scenario = {"name": "a", "road": {"track": "hockenheim"}, "faults": good}
    jsonschema.validate(scenario, json_schema())
    bad = [
        {"kind": "noise", "channels": "Car.az"},
        {"kind": "drift", "channels": 3, "rate": 1},
        {"kind": "gain", "channels": ["imu", "Car.azz"], "factor": 2},
        {"kind": "gain", "channels": [], "factor": 2},
    ]
    for fault in bad:
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({**scenario, "faults": [fault]}, json_schema())


def test_limits_name_figures_of_faults_by_their_labels(tmp_path: Path) -> None:
    fault = "{kind: gain, name: steep, channels: imu, factor: 2}"
    right = "[{metric: faults.steep.during.rmse_m_s, max: 1}]"
    load(write_scenario(tmp_path, sections={"faults": f"[{fault}]", "limits": right}))
    wrong = "[{metric: faults.steap.during.rmse_m_s, max: 1}]"
    found = problems(tmp_path, f"[{fault}]", limits=wrong)
    assert found[0].endswith("did you mean 'faults.steep.during.rmse_m_s'?")


# ---------------------------------------------------------------- runs

FAULTY = (
    "[{kind: dropout, channels: wheel_speeds, fill: nan, share: 0.5, start_s: 0.5, end_s: 0.6},"
    " {kind: noise, channels: angular_rates, rms: 1 deg/s, start_s: 0.2},"
    " {kind: jitter, channels: imu, max_ms: 15},"
    " {kind: bias, name: later, channels: Car.az, value: 1, start_s: 50}]"
)


def run(folder: Path, *overrides: str, **sections: str) -> Any:
    given = {"faults": FAULTY, "sensor": "{estimator: body_motion, condition: production}"}
    path = write_scenario(folder, obstacles=BUMPS, sections={**given, **sections})
    return execute(load(path, overrides), folder / "out")


def test_the_record_keeps_what_the_car_had_and_what_the_sensor_got(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    clean = run(tmp_path / "a", faults="[]").runs[0].recorder
    outcome = run(tmp_path)
    record = outcome.runs[0].recorder
    np.testing.assert_array_equal(record.group("measured"), clean.group("channels"))
    np.testing.assert_array_equal(record.group("ideal"), clean.group("ideal"))
    np.testing.assert_array_equal(record.group("truth"), clean.group("truth"))
    given, measured = record.group("channels"), record.group("measured")
    missing = np.isnan(given)
    assert missing[:, 9:13].sum() == 4 * missing[:, 9].sum() > 0
    assert not missing[:50].any()
    assert not missing[60:].any()
    np.testing.assert_array_equal(given[:, 13], measured[:, 13])
    assert (given[21:, 3:6] != measured[21:, 3:6]).all()
    assert clean.group("measured").size == 0
    assert outcome.notes == ("fault later never acted: the run ended at 1.00 s",)
    header = (tmp_path / "out" / "signals.csv").read_text().splitlines()[0]
    assert "Measured.Car.az [m/s2]" in header


def test_the_same_seed_gives_the_same_files_and_another_one_does_not(tmp_path: Path) -> None:
    signals = []
    for seed in (1, 1, 2):
        run(tmp_path, f"seed={seed}")
        signals.append((tmp_path / "out" / "signals.csv").read_bytes())
    assert signals[0] == signals[1]
    assert signals[0] != signals[2]


def test_figures_are_of_the_rows_before_during_and_after(tmp_path: Path) -> None:
    outcome = run(
        tmp_path,
        faults="[{kind: bias, name: hit, channels: Car.az, value: 20, start_s: 6, end_s: 6.2}]",
        duration="13",
        road=f"{{track: straight, length_m: 250, obstacles: [{BUMPS}]}}",
    )
    record, found = outcome.runs[0].recorder, outcome.runs[0].figures["faults"]["hit"]
    error = record.group("estimate") - record.group("truth")
    parts = {"before": slice(100, 600), "during": slice(600, 620), "after": slice(620, 1120)}
    for part, rows in parts.items():
        valid = record.group("valid")[rows, 0] > 0
        assert found[part]["valid_percent"] == pytest.approx(100 * valid.mean())
        expected = np.sqrt(np.mean(error[rows][valid] ** 2))
        assert found[part]["rmse_m_s"] == pytest.approx(expected)
        assert "covered_percent" not in found[part]  # the body's motion expects no deviation
    assert found["during"]["rmse_m_s"] > 2 * found["before"]["rmse_m_s"]


def test_sensor_and_controller_bear_channels_that_are_missing(tmp_path: Path) -> None:
    """One sample of NaN would stay in the controller's integrators for ever."""
    outcome = run(
        tmp_path,
        duration="4",
        faults="[{kind: dropout, channels: all, fill: nan, start_s: 0.5, end_s: 0.7}]",
        controllers="[{kind: skyhook, feedback: truth}, {kind: skyhook}]",
    )
    for one in outcome.runs:
        record = one.recorder
        assert np.isfinite(record.group("command")).all()
        assert np.ptp(record.group("command")[300:]) > 0.1
        valid = record.group("valid")[:, 0] > 0
        # bridged for 0.1 s; counted again 2 s after the channels are back
        assert valid[50:60].all()
        assert not valid[61:269].any()
        assert valid[270:].all()
        assert one.figures["valid_samples"] > 100
        assert one.figures["body_motion"] == one.figures["sensor"]


def test_a_late_sensor_is_the_prompt_one_samples_later(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    prompt = run(tmp_path / "a", faults="[]").runs[0].recorder
    late = run(tmp_path, faults="[]", latency="{sensor_ms: 30}").runs[0].recorder
    np.testing.assert_array_equal(late.group("estimate")[3:], prompt.group("estimate")[:-3])
    np.testing.assert_array_equal(late.group("valid")[3:], prompt.group("valid")[:-3])
    assert not late.group("valid")[:3].any()
    assert np.isnan(late.group("estimate")[:3]).all()


def test_late_dampers_hold_older_commands(tmp_path: Path) -> None:
    record = run(
        tmp_path,
        faults="[]",
        latency="{damper_ms: 20}",
        controllers="[{kind: skyhook, feedback: truth, initial_command: 0.6}]",
    ).runs[0].recorder  # fmt: skip
    held, command = record.group("held"), record.group("command")
    np.testing.assert_array_equal(held[:2], 0.6)
    np.testing.assert_array_equal(held[2:], command[:-2])
    assert np.ptp(command) > 0.1
    names = [signal.name for signal in record.signals_of("held")]
    assert names[0] == "Held.Car.SuspControl.DamperFL.CtrlOut"


def test_a_run_may_have_latencies_of_its_own(tmp_path: Path) -> None:
    controllers = (
        "[{kind: skyhook, feedback: truth}, {kind: skyhook, feedback: truth, name: prompt,"
        " latency: {}}, {kind: skyhook, feedback: truth, name: late, latency: {damper_ms: 10}}]"
    )
    outcome = run(tmp_path, faults="[]", latency="{damper_ms: 20}", controllers=controllers)
    shared, prompt, late = (one.recorder for one in outcome.runs)
    np.testing.assert_array_equal(shared.group("held")[2:], shared.group("command")[:-2])
    np.testing.assert_array_equal(late.group("held")[1:], late.group("command")[:-1])
    assert not prompt.group("held").size


def test_speed_and_motion_in_figures_are_the_car_s_not_the_faulty_ones(tmp_path: Path) -> None:
    fault = "[{kind: bias, channels: Car.vx, value: 50 km/h}]"
    sections = {"road": "{track: straight, length_m: 60}", "manoeuvre": "{kind: constant_speed}"}
    figures = []
    for faults in ("[]", fault):
        outcome = run(
            tmp_path, faults=faults, sensor="{estimator: zero}", duration="lap", **sections
        )
        figures.append(outcome.runs[0].figures["manoeuvre"])
    assert figures[0] == figures[1]


def test_a_data_set_keeps_the_channels_before_errors_and_faults(tmp_path: Path) -> None:
    record = run(tmp_path).runs[0].recorder
    kept = run_of(record, np.zeros(4), "a", {}).channels
    np.testing.assert_array_equal(kept, record.group("ideal").astype(np.float32))
    fault = "[{kind: gain, channels: all, factor: 2}]"
    record = run(tmp_path, faults=fault, sensor="{estimator: zero}").runs[0].recorder
    kept = run_of(record, np.zeros(4), "a", {}).channels
    np.testing.assert_array_equal(kept, record.group("measured").astype(np.float32))


def test_a_user_sees_faults_in_table_and_report(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, sections={"faults": FAULTY, "sensor": "{estimator: zero}"})
    out = tmp_path / "out"
    result = CliRunner().invoke(main, ["run", str(path), "--output-dir", str(out)])
    assert result.exit_code == 0, result.output
    assert "RMSE of the estimate around each fault" in result.stderr
    assert "note: fault later never acted: the run ended at 1.00 s" in result.stderr
    page = (out / "report.html").read_text()
    assert "RMSE of the estimate around each fault" in page
    text = page.split('id="signals">')[1].split("</script>")[0]
    drawn = json.loads(text)["runs"][0]
    assert drawn["faults"] == [[0.0, pytest.approx(1.01)]]
    assert [one["name"] for one in drawn["channels"]] == [*CHANNEL_NAMES[:6], *CHANNEL_NAMES[9:13]]
    assert run(tmp_path, faults="[]").notes == ()


def test_inspect_shows_the_faults(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, sections={"faults": FAULTY})
    result = CliRunner().invoke(main, ["inspect", str(path)])
    assert result.exit_code == 0, result.output
    assert "faults.1.rms" in result.stdout


def test_a_stand_in_for_the_sensor_is_late_too(tmp_path: Path) -> None:
    path = write_scenario(tmp_path, sections={"latency": "{sensor_ms: 20}"})
    scenario = load(path)
    built = assemble(scenario, scenario.controllers[0], Guess(window=1))
    built.run(None)
    valid = built.recorder.group("valid")[:, 0]
    np.testing.assert_array_equal(valid[:4], [0, 0, 1, 1])
