"""`cosim export-ssp`: valid by SSP's own schemas, run by FMPy's master, and what it cannot hold."""

from __future__ import annotations

import csv
import io
import os
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import fmpy
import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import SystemStructureDescription, read_ssd, read_ssv
from foreign_fmu import own_variables, parrot, report
from foreign_masters import Ssp, run_ssp
from loop_rig import write_scenario

from cosim.assembly import assemble
from cosim.cli import main
from cosim.control.fixed import FixedDampers
from cosim.fmi import Description
from cosim.quantities import DAMPERS, DRIVER
from cosim.scenario.load import load
from cosim.scenario.vehicle import Variable
from cosim.ssp.structure import structure_of
from cosim.vehicle import State, builtin_fmu
from cosim.wiring import mapped_wiring, own_wiring
from sensor.channels import CHANNELS, OUTPUTS
from sensor.runtime import OnnxSensor

Array = npt.NDArray[np.float64]

H = 0.01
NETWORK = "bilstm_w19"
BUMPS = "{kind: bumps, height_m: 0.03, length_m: 2, spacing_m: 5, from_m: 10, to_m: 90}"
SENSOR = builtin_fmu(2).with_name("sensor.fmi2.fmu")
INPUTS = [quantity.name for quantity in (*DRIVER, *DAMPERS)]


@dataclass(frozen=True)
class Exported:
    """A scenario and its package."""

    scenario: Path
    package: Path

    @property
    def structure(self) -> SystemStructureDescription:
        return read_ssd(str(self.package))  # validates against SystemStructureDescription.xsd

    def recorded(self) -> tuple[list[str], Array]:
        with zipfile.ZipFile(self.package) as archive:
            text = archive.read("extra/org.suspension-cosim/run.csv").decode()
        names, *rows = csv.reader(io.StringIO(text))
        return names, np.array(rows, dtype=np.float64)


def export(scenario: Path, out: Path, *arguments: str) -> Exported:
    done = CliRunner().invoke(main, ["export-ssp", str(scenario), "-o", str(out), *arguments])
    assert done.exit_code == 0, done.output
    return Exported(scenario, out)


@pytest.fixture(scope="module")
def bumps(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    folder = tmp_path_factory.mktemp("ssp")
    sections = {"sensor": f"{{estimator: {NETWORK}}}"}
    scenario = write_scenario(folder, duration="3", obstacles=BUMPS, sections=sections)
    return export(scenario, folder / "bumps.ssp")


def test_the_parts_and_every_wire(bumps: Exported) -> None:
    system = bumps.structure.system
    assert [component.name for component in system.elements] == ["vehicle", "sensor"]
    wires = {
        (w.endElement, w.endConnector): (w.startElement, w.startConnector)
        for w in system.connections
    }
    for name in INPUTS:
        assert wires["vehicle", name] == (None, name)
    for channel in CHANNELS:
        assert wires["sensor", channel.name] == ("vehicle", channel.name)
    for output in OUTPUTS:
        assert wires[None, output.name] == ("sensor", output.name)
    ends = {(None, c.name) for c in system.connectors}
    ends |= {(part.name, c.name) for part in system.elements for c in part.connectors}
    assert set(wires) | set(wires.values()) <= ends


def test_connectors_are_the_fmus_variables_with_their_units(bumps: Exported) -> None:
    with zipfile.ZipFile(bumps.package) as archive:
        content = archive.read("SystemStructure.ssd").decode()
        for name in ("vehicle", "sensor"):
            archive.extract(f"resources/{name}.fmu", bumps.package.parent)
    defined = {unit.name for unit in bumps.structure.units}
    for part in bumps.structure.system.elements:
        fmu = Description(bumps.package.parent / part.source)
        assert fmu.major == 2
        for connector in part.connectors:
            assert fmu.variables[connector.name].causality == connector.kind
            unit = fmu.unit_of(connector.name)
            assert unit is None or unit in defined
            assert f'name="{connector.name}" kind="{connector.kind}"' in content


def test_the_same_scenario_gives_the_same_bytes(bumps: Exported, tmp_path: Path) -> None:
    again = export(bumps.scenario, tmp_path / "again.ssp")
    assert again.package.read_bytes() == bumps.package.read_bytes()


def test_the_recorded_run_is_the_direct_one(bumps: Exported) -> None:
    names, rows = bumps.recorded()
    scenario = load(bumps.scenario)
    assembly = assemble(scenario, scenario.controllers[0])
    assembly.run(None)
    recorder = assembly.recorder
    assert names[1:8] == INPUTS
    np.testing.assert_array_equal(rows[:, 0], recorder.time)
    np.testing.assert_array_equal(rows[:, 1:4], recorder.group("driver"))
    np.testing.assert_array_equal(rows[:, 4:8], recorder.group("command"))
    np.testing.assert_array_equal(rows[:, 8:12], recorder.group("estimate"))


class Replay:
    """A driver that repeats commands (steps, 3)."""

    finished = False

    def __init__(self, commands: Array) -> None:
        self._commands = commands

    def step(self, k: int, state: State) -> Array:
        row: Array = self._commands[k]
        return row


def late(commands: Array, column: int) -> Callable[[float], float]:
    """An input for FMPy, which hands it on a step later."""
    return lambda t: float(commands[min(round(t / H) + 1, len(commands) - 1), column])


def as_fmpy_drives(bumps: Exported, commands: Array) -> tuple[Array, Array]:
    """Channels and estimates of our loop with these commands; FMPy's first inputs are zeros, and so
    is the sensor's first sample.
    """
    scenario = load(bumps.scenario, ["vehicle.fmi_version=2"])
    held = commands.copy()
    held[0] = 0.0
    passive = FixedDampers(0.3)
    assembly = assemble(scenario, scenario.controllers[0])
    assembly.blocks = replace(assembly.blocks, driver=Replay(held[:, :3]), controller=passive)
    assembly.run(None)
    channels = assembly.recorder.group("channels").copy()
    channels[0] = 0.0
    network = OnnxSensor(Path(str(assembly.files["sensor"])))
    return channels, network.apply(channels, np.zeros((0, 4)))


def test_fmpys_master_gives_the_direct_runs_estimates(bumps: Exported) -> None:
    """It stamps results a step early and hands values on a step late: row k holds the vehicle at
    t_k+1 and the sensor's estimate of the sample at t_k.
    """
    commands = bumps.recorded()[1][:, 1:8]
    steps = len(commands) - 1
    with zipfile.ZipFile(bumps.package) as archive:
        values = read_ssv(io.BytesIO(archive.read("resources/parameters.ssv")))
    for parameter in values.parameters:
        parameter.name = f"vehicle.{parameter.name}"
    rows = simulate_ssp(
        str(bumps.package), 0.0, (steps - 0.5) * H, H, parameter_set=values,
        input={name: late(commands, i) for i, name in enumerate(INPUTS)},
    )  # fmt: skip
    channels, estimates = as_fmpy_drives(bumps, commands)
    driven = np.column_stack([rows[f"vehicle.{c.name}"] for c in CHANNELS])
    np.testing.assert_array_equal(driven, channels[1 : steps + 1])
    assert np.ptp(channels[1:, 2]) > 1.0  # the bumps were there
    streamed = np.column_stack([rows[f"sensor.{o.name}"] for o in OUTPUTS])
    np.testing.assert_array_equal(rows["sensor.Sensor.Valid"][:18], 0)
    assert rows["sensor.Sensor.Valid"][18:].all()
    np.testing.assert_allclose(streamed[18:], estimates[18:steps], rtol=0, atol=1e-5)
    direct = bumps.recorded()[1][:, 8:12]
    assert np.abs(streamed[19:] - direct[19:steps]).max() < 0.01  # one step without pedals


@pytest.mark.parametrize("master", ["libcosimpy", "ecospy"])
def test_other_masters_give_the_direct_runs_estimates(
    bumps: Exported, tmp_path: Path, master: str
) -> None:
    """Structure, start values and road, read by libcosim from a folder and by Ecos as a file; a
    step's end has the estimate of the sample at its beginning.
    """
    package = export(bumps.scenario, tmp_path / "b.ssp", "--components-only")
    with zipfile.ZipFile(package.package) as archive:
        archive.extractall(tmp_path / "b")
    recorded = package.recorded()[1]
    ssp = Ssp(package.package, tmp_path / "b", H, tuple(INPUTS), recorded[:-1, 1:8].tolist(),
              tuple(o.name for o in OUTPUTS))  # fmt: skip
    rows = np.array(run_ssp(master, ssp))
    direct = recorded[:-1, 8:12]
    assert np.ptp(direct[18:]) > 0.1  # m/s: the bumps were there
    np.testing.assert_allclose(rows[18:], direct[18:], rtol=0, atol=1e-5)


def test_the_road_is_in_the_vehicle(bumps: Exported, tmp_path: Path) -> None:
    with zipfile.ZipFile(bumps.package) as archive:
        fmu = Path(archive.extract("resources/vehicle.fmu", tmp_path))
    assert Description(fmu).model.guid == Description(builtin_fmu(2)).model.guid
    with zipfile.ZipFile(fmu) as archive:
        assert "resources/road.crg" in archive.namelist()
    assert fmpy.supported_platforms(str(fmu)) == fmpy.supported_platforms(str(builtin_fmu(2)))


def test_another_vehicles_units_and_signs_are_in_the_connections(tmp_path: Path) -> None:
    variables = own_variables()
    for name, unit in (("Car.vx", "km/h"), ("DM.Steer.Ang", "deg")):
        variables[name] = replace(variables[name], unit=unit)
    fmu = parrot(tmp_path / "parrot.fmu", tuple(variables.values()), version=2)
    vehicle, sensor = Description(fmu), Description(SENSOR)
    mapping = {"Car.ay": Variable(name="Car.ay", scale=-1.0)}
    wiring, problems = mapped_wiring(vehicle, mapping, report)
    assert not problems
    structure = structure_of("foreign", "", wiring, vehicle, sensor)
    by_target = {connection.target: connection for connection in structure.connections}
    speed = by_target["sensor", "Car.vx"]
    assert speed.factor * 36.0 + speed.offset == pytest.approx(10.0)
    assert by_target["sensor", "Car.ay"].factor == -1.0
    steer = by_target["vehicle", "DM.Steer.Ang"]
    assert steer.factor * np.pi + steer.offset == pytest.approx(180.0)
    assert not by_target["sensor", "Car.ax"].converts
    assert structure.units["km/h"] == {"m": 1, "s": -1, "factor": pytest.approx(1 / 3.6)}


def test_of_the_packages_own_vehicle_nothing_is_converted() -> None:
    vehicle, sensor = Description(builtin_fmu(2)), Description(SENSOR)
    structure = structure_of("own", "", own_wiring(), vehicle, sensor)
    assert not any(connection.converts for connection in structure.connections)
    assert {("sensor", d.name) for d in DAMPERS} <= {c.target for c in structure.connections}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--set", "sensor.condition=production"], ["without condition production; take ideal"]),
        (["--set", "sensor.estimator=kalman"], ["estimator kalman is no network"]),
        (["--set", "latency.sensor_ms=20"], ["without latencies; leave them out"]),
        (["--set", "faults=[{kind: bias, channels: [Car.az], value: 1}]"], ["without faults"]),
        (
            ["--set", "sensor.estimator=fir_w19", "--set", "sensor.condition=production"],
            ["condition production", "estimator fir_w19"],
        ),
        (["--controller", "pasive"], ["the scenario has passive; did you mean 'passive'?"]),
    ],
)
def test_what_an_ssp_cannot_hold(
    arguments: list[str], words: list[str], bumps: Exported, tmp_path: Path
) -> None:
    out = tmp_path / "x.ssp"
    line = ["export-ssp", str(bumps.scenario), "-o", str(out), *arguments]
    done = CliRunner().invoke(main, line)
    assert done.exit_code == 2, done.output
    for word in words:
        assert word in done.output
    assert "Traceback" not in done.output
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_is_no_packages(bumps: Exported, tmp_path: Path) -> None:
    """Nothing is put in the place of a file of another kind, or of a device."""
    out = tmp_path / "null"
    os.mkfifo(out)
    done = CliRunner().invoke(main, ["export-ssp", str(bumps.scenario), "-o", str(out)])
    assert done.exit_code == 2
    assert "the name of a package ends in .ssp" in done.output
    assert out.is_fifo()


def test_a_folder_that_is_not_there(bumps: Exported, tmp_path: Path) -> None:
    out = tmp_path / "none" / "x.ssp"
    done = CliRunner().invoke(main, ["export-ssp", str(bumps.scenario), "-o", str(out)])
    assert done.exit_code == 2
    assert "there is no folder" in done.output
