"""One FMU behind `Slave`: the bits of a plain FMPy loop, and what is said when a call fails."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import numpy.typing as npt
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from foreign_fmu import Variable, own_variables, parrot, repackage, variables_of

from cosim.errors import FmuError
from cosim.fmi import Description, Slave, Value
from cosim.road import Bumps, Smooth, build_road, load_track
from cosim.vehicle import builtin_fmu

Array = npt.NDArray[np.float64]

H, STEPS = 0.01, 250
INPUTS = (
    "DM.Steer.Ang", "DM.Gas", "DM.Brake", "Road.Friction",
    *(f"Car.SuspControl.Damper{corner}.CtrlOut" for corner in ("FL", "FR", "RL", "RR")),
)  # fmt: skip


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Value]:
    """Start values of every type: on bumps, at 15 m/s."""
    road = build_road(
        load_track("straight", 100.0),
        Smooth(),
        tmp_path_factory.mktemp("road"),
        [Bumps(0.03, 0.5, 4.0)],
    )
    return {"Road.File": str(road), "Init.Velocity": 15.0, "SlipControl.Active": False}


def commands() -> Array:
    """Inputs of every step (STEPS, 8), all of them changing at every step."""
    t = H * np.arange(STEPS)
    pedal = np.sin(2 * t)
    dampers = [0.5 + 0.5 * np.sin((3 + i) * t + i) for i in range(4)]
    held = [np.sin(3 * t), pedal.clip(0, 1), 0.4 * (-pedal).clip(0, 1), 0.8 + 0.2 * np.cos(t)]
    return np.column_stack([*held, *dampers])


def outputs_of(description: Description) -> list[str]:
    return [n for n, v in description.variables.items() if v.causality == "output"]


def our_loop(version: int, start: dict[str, Value]) -> Array:
    description = Description(builtin_fmu(version))
    slave = Slave(description, INPUTS, outputs_of(description))
    slave.inputs[INPUTS.index("Road.Friction")] = 1.0
    slave.initialise(start)
    rows = []
    for k, values in enumerate(commands()):
        slave.read()
        rows.append(slave.outputs.copy())
        slave.inputs[:] = values
        slave.step(k, H)
    slave.close()
    return np.array(rows)


def fmpy_loop(version: int, start: dict[str, Value]) -> Array:
    """The same run through FMPy's own classes, the way its documentation does it."""
    description = fmpy.read_model_description(str(builtin_fmu(version)))
    by_name = {v.name: v for v in description.modelVariables}
    folder = fmpy.extract(str(builtin_fmu(version)))
    fmu = {2: FMU2Slave, 3: FMU3Slave}[version](
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    fmu.instantiate()
    read, write = (fmu.getReal, fmu.setReal) if version == 2 else (fmu.getFloat64, fmu.setFloat64)
    for name, value in start.items():
        getattr(fmu, f"set{by_name[name].type}", write)([by_name[name].valueReference], [value])
    if version == 2:
        fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    outputs = [v.valueReference for v in description.modelVariables if v.causality == "output"]
    inputs = [by_name[name].valueReference for name in INPUTS]
    rows = []
    for k, values in enumerate(commands()):
        rows.append(read(outputs))
        write(inputs, values.tolist())
        fmu.doStep(k * H, H)
    fmu.freeInstance()
    return np.array(rows)


@pytest.fixture(scope="module")
def ours(start: dict[str, Value]) -> dict[int, Array]:
    return {version: our_loop(version, start) for version in (2, 3)}


@pytest.mark.parametrize("version", [2, 3])
def test_a_run_has_the_bits_of_a_plain_fmpy_loop(
    version: int, start: dict[str, Value], ours: dict[int, Array]
) -> None:
    expected = fmpy_loop(version, start)
    assert expected.std(axis=0).max() > 1  # the car was really driven
    np.testing.assert_array_equal(ours[version], expected)


def test_both_standards_give_the_same_bits(ours: dict[int, Array]) -> None:
    np.testing.assert_array_equal(ours[2], ours[3])


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def parrot_fmu(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    return parrot(tmp_path / "parrot.fmu", version=request.param)


@pytest.fixture
def scratch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that FMUs are extracted to."""
    folder = tmp_path / "scratch"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def test_the_arrays_stay_where_they_are(parrot_fmu: Path) -> None:
    slave = Slave(Description(parrot_fmu), ["DM.Gas"], ["Car.ax", "Car.ay"])
    inputs, outputs = slave.inputs, slave.outputs
    slave.initialise({})
    for k in range(3):
        slave.read()
        np.testing.assert_array_equal(outputs, [1.0 + k, 2.0 + k])
        slave.step(k, H)
    assert slave.inputs is inputs
    assert slave.outputs is outputs
    slave.close()


def test_time_is_the_step_number_times_the_step(parrot_fmu: Path) -> None:
    slave = Slave(Description(parrot_fmu), [], ["Parrot.Time", "Parrot.Step"])
    slave.initialise({})
    for k in (0, 1, 35, 123_457):  # added up, 0.01 is off by 2e-8 at the last of these
        slave.step(k, H)
        slave.read()
        assert slave.outputs.tolist() == [k * H, H]
    slave.close()


def test_inputs_are_there_from_the_initialisation_on(parrot_fmu: Path) -> None:
    variables = own_variables() | {"Echo": Variable("Echo", 201)}  # of the second input
    path = parrot(parrot_fmu, tuple(variables.values()), Description(parrot_fmu).major)
    slave = Slave(Description(path), ["DM.Steer.Ang", "DM.Gas"], ["Echo"])
    slave.inputs[:] = 0.1, 0.7
    slave.initialise({"DM.Gas": 0.3})  # the caller's array counts, not a start value
    slave.read()
    assert slave.outputs.tolist() == [0.7]
    slave.close()


def test_closing_twice_leaves_nothing_on_the_disk(parrot_fmu: Path, scratch: Path) -> None:
    slave = Slave(Description(parrot_fmu), [], ["Car.ax"])
    assert list(scratch.iterdir())
    slave.close()
    slave.close()
    assert not list(scratch.iterdir())


@pytest.mark.parametrize("version", [2, 3])
def test_instances_do_not_meet(version: int, tmp_path: Path) -> None:
    description = Description(parrot(tmp_path / "parrot.fmu", version=version))
    one, two = (Slave(description, [], ["Car.ax"]) for _ in range(2))
    for slave in (one, two):
        slave.initialise({})
    one.step(0, H)
    one.close()
    two.read()
    assert two.outputs.tolist() == [1.0]
    two.close()


# ---------------------------------------------------------------- what is said when a call fails


@pytest.mark.parametrize(("status", "word"), [(2, "Discard"), (3, "Error"), (4, "Fatal")])
def test_a_failed_step_names_file_time_and_status(parrot_fmu: Path, status: int, word: str) -> None:
    slave = Slave(Description(parrot_fmu), [], ["Car.ax"])
    slave.initialise({"Parrot.FailAt": 3, "Parrot.FailStatus": status})
    slave.step(0, H)
    slave.step(1, H)
    with pytest.raises(FmuError, match=rf"parrot\.fmu: could not step at t = 0\.02 s: .*{word}"):
        slave.step(2, H)
    slave.close()


def test_a_warning_lets_the_run_go_on(parrot_fmu: Path) -> None:
    slave = Slave(Description(parrot_fmu), [], ["Car.ax"])
    slave.initialise({"Parrot.FailAt": 1, "Parrot.FailStatus": 1, "Parrot.FailWords": 1})
    slave.read()
    before = slave.outputs[0]
    slave.step(0, H)
    slave.step(1, H)
    slave.read()
    assert slave.outputs[0] == before + 2  # the parrot counts its steps
    slave.close()


def test_the_fmus_own_words_are_passed_on(parrot_fmu: Path) -> None:
    slave = Slave(Description(parrot_fmu), [], ["Car.ax"])
    slave.initialise({"Parrot.FailAt": 1, "Parrot.FailStatus": 3, "Parrot.FailWords": 1})
    with pytest.raises(FmuError, match=r"t = 0 s: the parrot fell off its perch$"):
        slave.step(0, H)
    slave.close()


def test_words_of_another_call_are_not_blamed(parrot_fmu: Path) -> None:
    slave = Slave(Description(parrot_fmu), [], ["Car.ax"])
    slave.initialise({"Parrot.FailAt": 1, "Parrot.FailStatus": 3, "Parrot.Chatter": 1})
    with pytest.raises(FmuError) as caught:
        slave.step(0, H)
    assert "woken up" not in str(caught.value)
    slave.close()


def test_an_fmu_that_asks_for_the_end_is_not_stepped_on(tmp_path: Path) -> None:
    slave = Slave(Description(parrot(tmp_path / "parrot.fmu", version=3)), [], ["Car.ax"])
    slave.initialise({"Parrot.StopAt": 2})
    slave.step(0, H)
    with pytest.raises(FmuError, match=r"parrot\.fmu: .*end.* t = 0\.02 s"):
        slave.step(1, H)
    slave.close()


@pytest.mark.parametrize("version", [2, 3])
def test_start_values_that_the_fmu_refuses(version: int) -> None:
    """The file, the variable and the FMU's own words."""
    slave = Slave(Description(builtin_fmu(version)), [], ["Car.ax"])
    with pytest.raises(FmuError, match=rf"vehicle\.fmi{version}\.fmu: .*Body\.Mass.*500 to 10000"):
        slave.initialise({"Body.Mass": 3.0})
    slave.close()


@pytest.mark.parametrize("version", [2, 3])
def test_words_of_the_initialisation(tmp_path: Path, version: int) -> None:
    """In plain text: the standard has "#" doubled in a message."""
    slave = Slave(Description(builtin_fmu(version)), [], ["Car.ax"])
    with pytest.raises(FmuError, match=r"could not initialise: .*/rig #1/gone\.crg"):
        slave.initialise({"Road.File": str(tmp_path / "rig #1" / "gone.crg")})
    slave.close()


def test_a_type_that_cannot_be_set_is_named(tmp_path: Path) -> None:
    odd = Variable("Odd", 450, "parameter", type="Int64", start=1)
    slave = Slave(Description(parrot(tmp_path / "p.fmu", [odd, Variable("Out", 100)])), [], ["Out"])
    with pytest.raises(FmuError, match=r"Odd: .*Int64"):
        slave.initialise({"Odd": 1.0})
    slave.close()


# ---------------------------------------------------------------- files that are no such FMU


def test_no_zip_file(tmp_path: Path) -> None:
    path = tmp_path / "broken.fmu"
    path.write_bytes(b"PK nonsense")
    with pytest.raises(FmuError, match=r"broken\.fmu: not a readable FMU"):
        Description(path)


def test_no_model_description(tmp_path: Path) -> None:
    path = tmp_path / "empty.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "nothing")
    with pytest.raises(FmuError, match=r"empty\.fmu: not a readable FMU"):
        Description(path)


def test_model_exchange_only(parrot_fmu: Path, tmp_path: Path) -> None:
    def edit(root: ET.Element) -> None:
        next(root.iter("CoSimulation")).tag = "ModelExchange"

    path = repackage(parrot_fmu, tmp_path / "exchange.fmu", edit)
    with pytest.raises(FmuError, match=r"exchange\.fmu: .*co-simulation"):
        Description(path)


def test_no_binary_for_this_machine(parrot_fmu: Path, tmp_path: Path, scratch: Path) -> None:
    path = tmp_path / "elsewhere.fmu"
    with zipfile.ZipFile(parrot_fmu) as old, zipfile.ZipFile(path, "w") as new:
        new.writestr("modelDescription.xml", old.read("modelDescription.xml"))
        new.writestr("binaries/elsewhere/parrot.so", b"")
    with pytest.raises(FmuError, match=r"elsewhere\.fmu: could not load: "):
        Slave(Description(path), [], ["Car.ax"])
    assert not list(scratch.iterdir())


def test_model_description_of_another_build(tmp_path: Path) -> None:
    """The instantiation token does not fit: the FMU's own sentence says so."""

    def edit(root: ET.Element) -> None:
        root.set("instantiationToken", "{0}")

    path = repackage(builtin_fmu(), tmp_path / "mixed.fmu", edit)
    with pytest.raises(FmuError, match=r"mixed\.fmu: could not load: .*different builds"):
        Slave(Description(path), [], ["Car.ax"])


def test_units_of_variables_and_of_their_types(parrot_fmu: Path, tmp_path: Path) -> None:
    def edit(root: ET.Element) -> None:
        types = ET.SubElement(root, "TypeDefinitions")
        if root.get("fmiVersion") == "2.0":
            ET.SubElement(ET.SubElement(types, "SimpleType", name="Speed"), "Real", unit="m/s")
        else:
            ET.SubElement(types, "Float64Type", name="Speed", unit="m/s")
        clock = variables_of(root)["Parrot.Step"]
        (clock if clock.tag == "Float64" else clock[0]).set("declaredType", "Speed")

    description = Description(repackage(parrot_fmu, tmp_path / "typed.fmu", edit))
    assert description.unit_of("Car.vx") == "m/s"
    assert description.unit_of("Parrot.Step") == "m/s"
    assert description.unit_of("Parrot.Time") is None
