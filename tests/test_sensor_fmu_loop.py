"""A sensor FMU in the loop: the ONNX block's results, its files among the run's, its mistakes."""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import shipped_fmus as fmus
from click.testing import CliRunner
from foreign_fmu import own_variables, parrot
from loop_rig import write_scenario
from sensor_rig import TOLERANCE, signal

from cosim.assembly import assemble
from cosim.cli import main
from cosim.errors import FmuError
from cosim.faults.assemble import over_gaps
from cosim.loop import SensorBlock
from cosim.recorder import Recorder
from cosim.run import execute
from cosim.scenario.load import load
from cosim.scenario.schema import Scenario
from cosim.sensor_fmu import FmuSensor
from sensor.carried.runtime import CarriedSensor
from sensor.estimators import open_network

Array = npt.NDArray[np.float64]
SCENARIOS = Path(__file__).parents[1] / "scenarios"
DEVIATION_TOLERANCE = 5e-5  # of itself: it is an exponential, beyond 1 m/s in noise
BUMPS = "{kind: bumps, height_m: 0.02, length_m: 0.5, spacing_m: 5}"
KINDS: dict[str, dict[str, str]] = {
    "road": {},
    "production": {"sensor": "{condition: production}"},
    "manoeuvre": {"manoeuvre": "{kind: double_lane_change}", "driver": "{speed_kmh: 30}"},
    "late": {"latency": "{sensor_ms: 10, damper_ms: 20}"},
    "truth": {"controllers": "[{kind: skyhook, feedback: truth}]"},
}


def ran(folder: Path, sensor: str, sections: dict[str, str]) -> Recorder:
    """The record of a short run with a sensor by its file."""
    parts = dict(sections)
    condition = ", condition: production" if "sensor" in parts else ""
    parts["sensor"] = "{" + sensor + condition + "}"
    road = {} if "manoeuvre" in parts else {"obstacles": BUMPS}
    path = write_scenario(folder, duration="3", sections=parts, **road)
    text = path.read_text(encoding="utf-8")
    if "manoeuvre" in parts:  # ends by itself, on a road as long as it needs
        text = text.replace("duration: 3", "duration: lap").replace("length_m: 150, ", "")
        path.write_text(text, encoding="utf-8")
    return execute(load(path), folder / "out").runs[0].recorder


@pytest.mark.parametrize("model", fmus.KINDS)
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_run_gives_what_the_network_gives(
    tmp_path: Path, model: str, kind: str
) -> None:
    fmu = fmus.Shipped(model, 3 if kind in ("road", "late") else 2)
    records = [
        ran(tmp_path, sensor, KINDS[kind])
        for sensor in (f"fmu: {fmu.path}", f"network: {fmu.network}")
    ]
    for group in ("valid", "channels", "estimate", "deviation", "command", "truth"):
        found, wanted = (record.group(group) for record in records)
        np.testing.assert_allclose(found, wanted, rtol=0.0, atol=TOLERANCE, err_msg=group)
    assert records[0].group("valid").any()
    assert np.nanmax(np.abs(records[0].group("estimate"))) > 0.01


class Beside:
    """A sensor FMU in the loop, and its network on the same samples: skyhook switches where a
    velocity changes its sign, so two closed loops would drift apart from the last digit on.
    """

    def __init__(self, fmu: SensorBlock, network: SensorBlock) -> None:
        self._fmu, self._network = fmu, network
        self.estimate, self.deviation = fmu.estimate, fmu.deviation
        self.counted = 0

    def step(self, measured: Array, command: Array) -> bool:
        valid = self._fmu.step(measured, command)
        assert self._network.step(measured, command) == valid
        fmu, network = self._fmu, self._network
        np.testing.assert_allclose(fmu.estimate, network.estimate, rtol=0.0, atol=TOLERANCE)
        np.testing.assert_allclose(
            fmu.deviation, network.deviation, rtol=DEVIATION_TOLERANCE, atol=TOLERANCE
        )
        self.counted += valid
        return valid


def run_beside(scenario: Scenario, fmu: fmus.Shipped) -> int:
    """Run a scenario with both; returns how many estimates counted."""
    counted = 0
    for controller in scenario.controllers:
        faults, sensor = scenario.acting_faults, FmuSensor(fmu.path)
        network = open_network(fmu.network)
        beside = Beside(over_gaps(sensor, faults), over_gaps(network, faults))
        assemble(scenario, controller, beside).run(None)
        sensor.close()
        counted += beside.counted
    return counted


@pytest.mark.parametrize("model", fmus.KINDS)
def test_a_loop_closed_over_the_fmu(tmp_path: Path, model: str) -> None:
    closed = {"controllers": "[{kind: skyhook, feedback: estimate}]"}
    path = write_scenario(tmp_path, duration="3", obstacles=BUMPS, sections=closed)
    assert run_beside(load(path), fmus.Shipped(model, 3)) >= 250


@pytest.mark.validation
@pytest.mark.parametrize("path", sorted(SCENARIOS.rglob("*.yaml")), ids=lambda path: path.stem)
def test_every_scenario_gives_what_the_network_gives(path: Path) -> None:
    if "datasets" in path.parts:
        pytest.skip("a recipe, no scenario")
    assert run_beside(load(path), fmus.Shipped("carried", 3)) > 100


def test_the_fmu_is_among_the_files_of_a_run(tmp_path: Path) -> None:
    fmu = fmus.Shipped("small carried", 3)
    scenario = write_scenario(
        tmp_path, sections={"sensor": f"{{fmu: {fmu.path}}}", "controllers":
                            f"[{{kind: passive}}, {{kind: passive, name: b, fmu: {fmu.path}}}]"}
    )  # fmt: skip
    result = CliRunner().invoke(main, ["run", str(scenario), "--output-dir", str(tmp_path / "o")])
    assert result.exit_code == 0, result.output
    versions = json.loads((tmp_path / "o" / "versions.json").read_text(encoding="utf-8"))
    assert str(fmu.path) in json.dumps(versions)
    resolved = load(tmp_path / "o" / "scenario.resolved.yaml")
    assert resolved.sensor.fmu == str(fmu.path)
    assert resolved.controllers[1].fmu == str(fmu.path)


# ---------------------------------------------------------------- the block alone


@pytest.fixture(params=fmus.SMALL, ids=str)
def fmu(request: pytest.FixtureRequest) -> fmus.Shipped:
    return request.param


@pytest.fixture
def block(fmu: fmus.Shipped) -> Iterator[FmuSensor]:
    made = FmuSensor(fmu.path)
    yield made
    made.close()


def test_the_block_is_the_network(block: FmuSensor, fmu: fmus.Shipped) -> None:
    """Each sample with the command that was held until it, as the loop hands them over."""
    channels, commands = signal(300)
    network = open_network(fmu.network)
    found, deviation = block.apply_with_deviation(channels, commands)
    wanted = network.apply(channels, commands)
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=TOLERANCE)
    assert np.isfinite(found[-1]).all()
    if isinstance(network, CarriedSensor):
        expected = network.apply_with_deviation(channels, commands)[1]
        np.testing.assert_allclose(deviation, expected, rtol=0.0, atol=TOLERANCE)
        other = block.apply(channels, np.roll(commands, 1, axis=0))
        assert np.nanmax(np.abs(other - found)) > 1e-4  # the commands count
    else:
        assert np.isnan(deviation).all()


def test_reset_forgets_everything(block: FmuSensor) -> None:
    channels, commands = signal(200)
    first = block.apply(channels, commands)
    block.step(channels[0], commands[0])
    block.reset()
    block.reset()
    np.testing.assert_array_equal(block.apply(channels, commands), first)


def test_a_step_allocates_nothing(block: FmuSensor) -> None:
    channels, commands = signal(300)
    for k in range(100):
        block.step(channels[k], commands[k])
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for k in range(100, 300):
        block.step(channels[k], commands[k])
    now, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert now - before < 256
    assert peak - before < 1024


def test_a_channel_without_a_value_stops_nothing(block: FmuSensor) -> None:
    channels, commands = (part.copy() for part in signal(300))
    channels[120, 5] = np.nan
    found = block.apply(channels, commands)
    assert np.isnan(found[120]).all()
    assert np.isfinite(found[[119, 200]]).all()


# ---------------------------------------------------------------- mistakes


def test_an_fmu_that_is_no_sensor_is_named_with_what_it_lacks(tmp_path: Path) -> None:
    vehicle = fmus.Shipped("vehicle", 3).path
    scenario = write_scenario(tmp_path, sections={"sensor": f"{{fmu: {vehicle}}}"})
    result = CliRunner().invoke(main, ["run", str(scenario), "--output-dir", str(tmp_path / "o")])
    assert result.exit_code == 3
    assert "this is no sensor FMU" in result.stderr
    assert "'Car.ax' is of causality output, where input belongs" in result.stderr
    assert "it has no Boolean output 'Sensor.Valid'" in result.stderr
    assert "Traceback" not in result.output


def test_a_unit_of_another_kind_is_named(tmp_path: Path) -> None:
    parrot(tmp_path / "p.fmu", tuple(own_variables().values()))
    with pytest.raises(FmuError, match=r"it has no output 'VRel\.FL'"):
        FmuSensor(tmp_path / "p.fmu")


def test_the_template_says_that_it_has_no_network() -> None:
    template = fmus.Shipped("vehicle", 3).path.with_name("sensor.fmi3.fmu")
    with pytest.raises(FmuError) as caught:
        FmuSensor(template)
    assert "network.bin: It cannot be opened. `cosim" in str(caught.value)
    assert "`cosim pack` puts a network into" in str(caught.value)


def test_kind_fmu_gets_a_hint(tmp_path: Path) -> None:
    scenario = write_scenario(tmp_path, sections={"sensor": "{kind: fmu, file: s.fmu}"})
    result = CliRunner().invoke(main, ["run", str(scenario)])
    assert result.exit_code == 2
    assert "'kind' is not a field of sensor" in result.stderr
