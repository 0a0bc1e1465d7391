"""The closed loop over a bus with a sensor in a process of its own: the program as it is used."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bus_rig import free_udp
from click.testing import CliRunner
from loop_rig import write_scenario

from cosim.assembly import assemble
from cosim.batch.job import Job
from cosim.batch.worker import check
from cosim.bus.codec import from_sensor, to_sensor
from cosim.bus.transport import Address, Link
from cosim.cli import main
from cosim.errors import BusError, InputError
from cosim.isolation import Children
from cosim.run import execute
from cosim.scenario.load import load
from cosim.scenario.schema import Scenario
from sensor.estimators import make

ESTIMATOR = "fir_residual_w19"  # linear and quick, with raw and residual channels


def bus_section(address: Address, *more: str) -> str:
    port = address.options["port"]
    fields = ", ".join((f"options: {{port: {port}}}", "deadline_ms: 5000", *more))
    return f"{{estimator: {ESTIMATOR}, bus: {{{fields}}}}}"


@pytest.fixture(scope="module")
def closed_loop(tmp_path_factory) -> tuple[dict, Path, Scenario]:
    """Metrics, results and scenario of a closed loop with its own node, direct and over the bus."""
    folder = tmp_path_factory.mktemp("bus")
    sections = {
        "sensor": bus_section(free_udp(), "connect_s: 120", "start_node: true"),
        "controllers": f"[{{kind: skyhook, name: direct, estimator: {ESTIMATOR}}}, "
        "{kind: skyhook, name: over_bus}]",
        "limits": "[{metric: over_bus.bus.frames_lost, max: 0}]",
    }
    path = write_scenario(folder, duration="4", surface="C", sections=sections)
    scenario = load(path)
    outcome = execute(scenario, folder / "results")
    assert outcome.exit_code == 0
    return outcome.metrics["runs"], folder / "results", scenario


class Quantised:
    """An estimator in this process that is given, and gives, what a bus would leave of it."""

    def __init__(self) -> None:
        self.estimate, self.deviation = np.full(4, np.nan), np.full(4, np.nan)
        self._estimator = make(ESTIMATOR, "ideal")
        self._to, self._from = to_sensor(), from_sensor()

    def step(self, measured: np.ndarray, command: np.ndarray) -> bool:
        given = self._to.quantised(np.concatenate([measured, command]))
        valid = self._estimator.step(given[:14], given[14:])
        both = np.concatenate([self._estimator.estimate, self._estimator.deviation])
        self.estimate[:], self.deviation[:] = np.split(self._from.quantised(both), 2)
        return valid


def test_the_loop_over_the_bus_is_the_loop_with_the_quantisation_bit_by_bit(closed_loop, tmp_path):
    _, folder, scenario = closed_loop
    assembly = assemble(scenario, scenario.controllers[1], Quantised())
    assembly.run(None)
    ours = assembly.recorder.write(tmp_path).read_bytes()
    assert ours.count(b"\n") == 402
    assert ours == (folder / "over_bus" / "signals.csv").read_bytes()


def test_what_comes_of_it_is_what_the_direct_loop_gives(closed_loop):
    direct, over_bus = closed_loop[0]["direct"], closed_loop[0]["over_bus"]
    assert direct["valid_samples"] == over_bus["valid_samples"] > 350
    # A command may switch at another sample, after which the loops are not the same any more.
    for part in ("FL", "FR", "RL", "RR"):
        rms = [run["truth"][part]["rms_m_s"] for run in (direct, over_bus)]
        assert rms[1] == pytest.approx(rms[0], rel=0.05)
        errors = [run["sensor"][part]["rmse_m_s"] for run in (direct, over_bus)]
        assert errors[1] == pytest.approx(errors[0], rel=0.05)
    for name in ("weighted_acceleration_m_s2", "deflection_rms_m", "tyre_load_rms_n"):
        assert over_bus["comfort"][name] == pytest.approx(direct["comfort"][name], rel=0.05), name


def test_latency_and_losses_are_measured(closed_loop):
    direct, bus = closed_loop[0]["direct"]["bus"], closed_loop[0]["over_bus"]["bus"]
    assert direct == {}
    assert bus["samples"] == bus["answers_in_time"] == 401
    assert bus["frames_lost"] == bus["late_answers"] == bus["values_out_of_range"] == 0
    assert 0.0 < bus["latency_p50_ms"] <= bus["latency_p99_ms"] <= bus["latency_max_ms"] < 5000.0
    assert 0.0 < bus["age_p50_ms"] < bus["latency_p50_ms"]


def test_a_node_on_the_command_line_is_stopped_by_a_signal_and_tells_what_it_did(tmp_path):
    address = free_udp()
    command = [sys.executable, "-m", "cosim", "sensor-node", "--estimator", ESTIMATOR, "--json"]
    command += ["--option", f"port={address.options['port']}", "--patience", "1000"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        section = bus_section(address, "connect_s: 120")
        path = write_scenario(tmp_path, sections={"sensor": section})
        result = CliRunner().invoke(main, ["run", str(path), "--output-dir", str(tmp_path / "out")])
        assert result.exit_code == 0, result.stderr
        assert "101 of 101 answers in time; latency median" in result.stderr
        assert "0 frames lost" in result.stderr
        process.send_signal(signal.SIGTERM)
        out, words = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 0
    figures = json.loads(out)
    assert figures["runs"] == 1
    assert figures["samples"] == 101
    assert figures["frames_lost"] == 0
    assert "fir_residual_w19 (ideal) on bus udp_multicast" in words
    assert "1 runs, 101 samples" in words


@pytest.fixture(scope="module")
def children():
    with Children(("cosim.batch.worker",)) as made:
        yield made


@pytest.mark.parametrize(
    ("bus", "private"),
    [
        ("{start_node: true}", True),
        ("{start_node: true, options: {port: 47000}}", False),
        ("{interface: udp_multicast, connect_s: 9}", False),
        ("{}", False),
    ],
)
def test_runs_that_would_meet_on_a_bus_go_one_after_another(children, tmp_path, bus, private):
    path = write_scenario(tmp_path, sections={"sensor": f"{{bus: {bus}}}"})
    assert load(path).sensor.bus.is_private == private
    checked = children.run(check, Job(path, tmp_path / "out"))
    assert checked.problems == ()
    assert checked.alone != private


def test_a_node_that_cannot_start_says_why_before_the_first_step(tmp_path):
    network = tmp_path / "broken.onnx"
    network.write_bytes(b"no network")
    port = free_udp().options["port"]
    section = f"{{network: broken.onnx, bus: {{start_node: true, options: {{port: {port}}}}}}}"
    path = write_scenario(tmp_path, sections={"sensor": section})
    result = CliRunner().invoke(main, ["run", str(path), "--output-dir", str(tmp_path / "out")])
    assert result.exit_code == 3
    assert "has ended" in result.stderr
    assert "broken.onnx" in result.stderr


def test_the_end_of_the_run_s_own_node_is_the_end_of_the_run(tmp_path):
    section = bus_section(free_udp(), "connect_s: 120", "start_node: true")
    section = section.replace("deadline_ms: 5000", "deadline_ms: 1000")
    path = write_scenario(tmp_path, sections={"sensor": section})
    scenario = load(path)
    assembly = assemble(scenario, scenario.controllers[0])
    own = assembly.bus._process

    def kill(done: int, total: int) -> None:
        if done == 50:
            own._process.kill()

    with pytest.raises(BusError, match=r"the sensor on bus .* has ended: signal 9 \(Killed"):
        assembly.run(kill)
    assert assembly.recorder.rows == 51
    assert "frames_lost" not in assembly.bus.figures()


def test_another_estimator_on_the_bus_than_in_the_scenario(tmp_path):
    address = free_udp()
    command = [sys.executable, "-m", "cosim", "sensor-node", "--estimator", "zero", "--idle", "120"]
    command += ["--option", f"port={address.options['port']}"]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        path = write_scenario(tmp_path, sections={"sensor": bus_section(address, "connect_s: 120")})
        result = CliRunner().invoke(main, ["run", str(path), "--output-dir", str(tmp_path / "out")])
    finally:
        process.kill()
        process.wait()
    assert result.exit_code == 3
    assert "another estimator than the scenario names" in result.stderr


def test_what_a_scenario_may_say_wrong_of_its_bus(tmp_path, monkeypatch):
    def messages(bus: str) -> str:
        path = write_scenario(tmp_path, sections={"sensor": f"{{bus: {bus}}}"})
        with pytest.raises(InputError) as caught:
            execute(load(path), tmp_path / "out")
        return str(caught.value)

    assert "mean 'socketcan'" in messages("{interface: soketcan}")
    assert "sensor.bus.deadline_ms must be at least 0 ms, not -1 ms" in messages(
        "{deadline_ms: -1}"
    )
    assert "mean 'channel'" in messages("{chanel: can0}")
    assert "sensor.bus.channel must be text or a whole number" in messages("{channel: [1]}")
    option = "sensor.bus.options.port must be text, a number, true or false, not a list"
    assert messages("{options: {port: [1]}}").count("must be") == 1
    assert option in messages("{options: {port: [1]}}")
    assert "did you mean 'port'" in messages("{options: {prot: 47000}}")
    assert "sensor.bus must be a mapping of fields, not 'can0'" in messages("can0")
    assert "take udp_multicast" in messages("{interface: virtual, start_node: true}")
    monkeypatch.setitem(sys.modules, "cantools", None)
    sentence = r"a sensor on a bus needs cantools; pip install 'suspension-cosim[can]'"
    assert sentence in messages("{}")
    with pytest.raises(InputError, match=r"suspension-cosim\[can\]"):
        Link(free_udp())
