"""Which variable carries which quantity: names, units, signs, and everything wrong at once."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner
from foreign_fmu import (
    ECHO,
    OUTPUT,
    UNITS,
    Map,
    Variable,
    define_unit,
    own_variables,
    parrot,
    repackage,
    report,
    set_unit,
    variables_of,
)  # fmt: skip
from loop_rig import Blind, write_scenario

from cosim.assembly import Assembly, assemble
from cosim.cli import main
from cosim.fmi import Description
from cosim.quantities import (
    CHANNEL_QUANTITIES,
    DRIVER,
    INPUT_QUANTITIES,
    OUTPUT_QUANTITIES,
    POSE,
    QUANTITIES,
    TRUTH,
)  # fmt: skip
from cosim.scenario.load import load
from cosim.vehicle import Vehicle, builtin_fmu
from cosim.wiring import Mapped, Wiring, mapped_wiring, own_wiring

Array = npt.NDArray[np.float64]

VX = 6  # Car.vx among the channels
SPEEDS = ("Car.vx", "Car.vFL", "Car.vFR", "Car.vRL", "Car.vRR")
ANGLES = ("Car.SteerAngleFL", "Car.SteerAngleFR", "Steer.WhlAng", "Car.Yaw", "DM.Steer.Ang")


def wire(fmu: Path, mapping: Mapping[str, Mapped] | None = None) -> tuple[Wiring, list[str]]:
    wiring, problems = mapped_wiring(Description(fmu), mapping or {}, report)
    return wiring, [problem.message for problem in problems]


def changed(path: Path, version: int, *variables: Variable, without: Iterable[str] = ()) -> Path:
    """A parrot with some variables other than the vehicle's own, or left out."""
    kept = own_variables() | {v.name: v for v in variables}
    return parrot(path, [v for v in kept.values() if v.name not in without], version)


# ---------------------------------------------------------------- what fits


def test_an_fmu_with_our_names_needs_no_map(version: int, tmp_path: Path) -> None:
    assert wire(parrot(tmp_path / "p.fmu", version=version)) == (own_wiring(), [])


def test_the_packages_own_fmu_is_wired_like_any_other(version: int) -> None:
    assert wire(builtin_fmu(version)) == (own_wiring(), [])


def test_the_packages_own_fmu_states_the_units_of_the_quantities(version: int) -> None:
    description = Description(builtin_fmu(version))
    for quantity in QUANTITIES.values():
        assert description.unit_of(quantity.variable) == quantity.unit
        assert abs(quantity.scale) == 1.0


def test_outputs_are_converted_by_the_fmus_own_definitions(version: int, tmp_path: Path) -> None:
    own = own_variables()
    units = {"Car.vx": "km/h", "Car.SteerAngleFL": "deg", "Car.ax": "g", "Car.tx": "m above"}
    fmu = changed(
        tmp_path / "p.fmu", version, *(replace(own[n], unit=unit) for n, unit in units.items())
    )
    wiring, problems = wire(fmu)
    assert not problems
    vehicle = Vehicle(Description(fmu), wiring, {}, 0.01)
    vehicle.connect()
    state = vehicle.read()
    said = {q.name: i + 1.0 for i, q in enumerate(OUTPUT_QUANTITIES)}  # see parrot.c
    channels = dict(zip((q.name for q in CHANNEL_QUANTITIES), state.channels, strict=True))
    assert channels["Car.vx"] == pytest.approx(said["Car.vx"] / 3.6, rel=1e-15)
    assert channels["Car.SteerAngleFL"] == pytest.approx(math.radians(said["Car.SteerAngleFL"]))
    assert channels["Car.ax"] == pytest.approx(said["Car.ax"] * 9.81, rel=1e-15)
    assert channels["Car.ay"] == said["Car.ay"]  # untouched
    assert state.pose[0] == said["Car.tx"] + 250.0
    assert state.truth.tolist() == [-said[q.name] for q in TRUTH]
    vehicle.stop()


def test_inputs_are_converted_the_other_way_round(version: int, tmp_path: Path) -> None:
    """The FMU is given its own units: echoes show what arrived."""
    own = own_variables()
    units = {"DM.Steer.Ang": "deg", "DM.Gas": "%", "DM.Brake": "% lifted"}
    echoes = [Variable(f"Echo.{i}", ECHO + i, unit=None) for i in range(7)]
    fmu = changed(
        tmp_path / "p.fmu",
        version,
        *(replace(own[n], unit=unit) for n, unit in units.items()),
        *echoes,
    )
    channels = [q.name for q in CHANNEL_QUANTITIES]
    wiring, problems = wire(fmu, {channels[i]: Map(f"Echo.{i}") for i in range(7)})
    assert not problems
    vehicle = Vehicle(Description(fmu), wiring, {}, 0.01)
    vehicle.connect()
    commands = np.array([0.1, 0.25, 0.5]), np.array([0.1, 0.2, 0.3, 0.4])
    vehicle.write(*commands)
    vehicle.step(0)
    arrived = vehicle.read().channels[:7].tolist()
    # 0.5 is what 100 % lifted means: 0.01 * 100 - 0.5
    assert arrived == pytest.approx([math.degrees(0.1), 25.0, 100.0, 0.1, 0.2, 0.3, 0.4])
    vehicle.stop()


def test_a_map_gives_names_and_signs(version: int, tmp_path: Path) -> None:
    """A mapped variable has the factor that the map says, not the one of our own variable."""
    fmu = changed(tmp_path / "p.fmu", version, Variable("Dampers.v1", OUTPUT, unit="m/s"))
    truth = TRUTH[0].name
    for scale in (1.0, -1.0, 0.5):
        wiring, problems = wire(fmu, {truth: Map("Dampers.v1", scale=scale)})
        assert not problems
        found = next(w for w in wiring.outputs if w.quantity.name == truth)
        assert (found.variable, found.factor, found.offset) == ("Dampers.v1", scale, 0.0)


def test_scale_comes_after_the_unit(version: int, tmp_path: Path) -> None:
    lifted = Variable("Height", OUTPUT, unit="m above")
    wiring, problems = wire(
        changed(tmp_path / "p.fmu", version, lifted), {"Car.tx": Map("Height", scale=-2.0)}
    )
    assert not problems
    found = next(w for w in wiring.outputs if w.variable == "Height")
    assert (found.factor, found.offset) == (-2.0, -500.0)


def test_a_unit_that_only_the_map_states(version: int, tmp_path: Path) -> None:
    silent = Variable("Speed", OUTPUT)
    fmu = changed(tmp_path / "p.fmu", version, silent)
    for unit, factor in (("km/h", 1 / 3.6), ("m/s", 1.0), (None, 1.0)):
        wiring, problems = wire(fmu, {"Car.vx": Map("Speed", unit)})
        assert not problems
        assert wiring.outputs[VX].factor == factor


def test_an_angle_may_be_counted_without_the_radian(version: int, tmp_path: Path) -> None:
    """FMI leaves it open whether rad is a base unit or 1."""
    plain = UNITS | {"rad": {}, "rad/s": {"s": -1}}
    fmu = parrot(tmp_path / "p.fmu", version=version, units=plain)
    assert wire(fmu) == (own_wiring(), [])


def test_what_is_not_required_may_be_missing(version: int, tmp_path: Path) -> None:
    optional = [q.variable for q in QUANTITIES.values() if not q.required]
    assert optional
    fmu = changed(tmp_path / "p.fmu", version, without=optional)
    wiring, problems = wire(fmu)
    assert not problems
    wired = {w.quantity.name for w in (*wiring.outputs, *wiring.inputs)}
    assert wired == {q.name for q in QUANTITIES.values() if q.required}
    vehicle = Vehicle(Description(fmu), wiring, {}, 0.01)
    vehicle.connect()
    state = vehicle.read()
    assert np.isfinite(state.channels).all()
    assert np.isfinite(state.truth).all()
    assert np.isnan(state.recorded[len(POSE) :]).all()
    vehicle.write(np.zeros(3), np.ones(4))  # no damper input to write to
    vehicle.step(0)
    vehicle.stop()


# ---------------------------------------------------------------- what does not fit


def test_unknown_quantity_with_the_nearest(tmp_path: Path) -> None:
    vehicle = f"{{fmu: {parrot(tmp_path / 'p.fmu')}, variables: {{Car.vxx: {{name: Car.vx}}}}}}"
    path = write_scenario(tmp_path, sections={"vehicle": vehicle})
    result = CliRunner().invoke(main, ["run", str(path), "--output-dir", str(tmp_path / "out")])
    assert "unknown quantity 'Car.vxx'; did you mean 'Car.vx'?" in result.stderr
    assert result.exit_code == 2


def test_unknown_variable(version: int, tmp_path: Path) -> None:
    _, problems = wire(parrot(tmp_path / "p.fmu", version=version), {"Car.ax": Map("IMU.acc.x")})
    assert problems == ["vehicle.variables.Car.ax.name: 'p.fmu' has no variable 'IMU.acc.x'"]


def test_missing_quantities_are_all_named_with_their_units(version: int, tmp_path: Path) -> None:
    gone = ("Car.ax", "Car.CFL.q0p", "Car.Yaw", "DM.Brake")
    _, problems = wire(changed(tmp_path / "p.fmu", version, without=gone))
    assert len(problems) == 4
    for name in ("Car.ax [m/s2]", "Truth.VRel.FL [m/s]", "Car.Yaw [rad]", "DM.Brake [1]"):
        assert any(name in problem for problem in problems)


@pytest.mark.parametrize(
    ("quantity", "causality", "needed"),
    [
        ("Car.ax", "input", "output"),
        ("Car.ax", "parameter", "output"),
        ("DM.Gas", "output", "input"),
        ("DM.Gas", "parameter", "input"),
    ],
)
def test_wrong_causality(
    version: int, tmp_path: Path, quantity: str, causality: str, needed: str
) -> None:
    _, problems = wire(
        changed(tmp_path / "p.fmu", version, Variable("X", OUTPUT, causality)),
        {quantity: Map("X")},
    )
    (problem,) = problems
    assert problem == (
        f"vehicle.variables.{quantity}.name: 'X' is {causality}; {quantity} needs {needed}"
    )


def test_local_variables_may_be_read(version: int, tmp_path: Path) -> None:
    fmu = changed(tmp_path / "p.fmu", version, Variable("X", OUTPUT, "local", "m/s2"))
    assert not wire(fmu, {"Car.ax": Map("X")})[1]


@pytest.mark.parametrize("kind", ["Boolean", "Int32", "String"])
def test_wrong_type(version: int, tmp_path: Path, kind: str) -> None:
    fmu = changed(tmp_path / "p.fmu", version, Variable("X", OUTPUT, type=kind))
    (problem,) = wire(fmu, {"Car.ax": Map("X")})[1]
    assert "Car.ax needs real numbers" in problem


@pytest.mark.parametrize("unit", ["m", "K", "m/s", "N"])
def test_wrong_dimension(version: int, tmp_path: Path, unit: str) -> None:
    fmu = changed(tmp_path / "p.fmu", version, replace(own_variables()["Car.ax"], unit=unit))
    (problem,) = wire(fmu)[1]
    assert f"'Car.ax' is in {unit}" in problem
    assert "Car.ax [m/s2]" in problem


@pytest.mark.parametrize(
    ("name", "unit"), [("Car.YawRate", "Hz"), ("DM.Gas", "deg")], ids=["hertz", "degrees"]
)
def test_a_unit_that_only_looks_right(tmp_path: Path, name: str, unit: str) -> None:
    fmu = changed(tmp_path / "p.fmu", 3, replace(own_variables()[name], unit=unit))
    assert len(wire(fmu)[1]) == 1


def test_undefined_unit(version: int, tmp_path: Path) -> None:
    fmu = changed(tmp_path / "p.fmu", version, replace(own_variables()["Car.vx"], unit="knot"))
    (problem,) = wire(fmu)[1]
    assert "does not define the unit knot of 'Car.vx'" in problem
    assert "scale" in problem


def test_undefined_unit_with_a_scale(version: int, tmp_path: Path) -> None:
    """What the message advises: the factor to the SI unit."""
    fmu = changed(tmp_path / "p.fmu", version, replace(own_variables()["Car.vx"], unit="knot"))
    wiring, problems = wire(fmu, {"Car.vx": Map("Car.vx", scale=0.5144)})
    assert not problems
    assert wiring.outputs[VX].factor == 0.5144


def test_an_array_is_no_quantity(tmp_path: Path) -> None:
    def edit(root: ET.Element) -> None:
        ET.SubElement(variables_of(root)["Car.ax"], "Dimension", start="3")

    fmu = repackage(parrot(tmp_path / "plain.fmu"), tmp_path / "p.fmu", edit)
    (problem,) = wire(fmu)[1]
    assert "'Car.ax'" in problem


def test_undefined_unit_that_is_ours_anyway(version: int, tmp_path: Path) -> None:
    assert wire(parrot(tmp_path / "p.fmu", version=version, units={})) == (own_wiring(), [])


def test_unit_of_the_map_against_that_of_the_fmu(version: int, tmp_path: Path) -> None:
    _, problems = wire(
        parrot(tmp_path / "p.fmu", version=version), {"Car.vx": Map("Car.vx", "km/h")}
    )
    assert problems == [
        "vehicle.variables.Car.vx.unit: the FMU declares 'Car.vx' in m/s, not in km/h"
    ]


def test_a_scale_of_zero_is_refused(tmp_path: Path) -> None:
    fmu = parrot(tmp_path / "p.fmu")
    assert wire(fmu, {"DM.Gas": Map("DM.Gas", scale=0.0)})[1]


def test_two_quantities_for_one_input_are_refused(tmp_path: Path) -> None:
    fmu = parrot(tmp_path / "p.fmu")
    assert wire(fmu, {"DM.Gas": Map("DM.Gas"), "DM.Brake": Map("DM.Gas")})[1]


# ---------------------------------------------------------------- through a scenario

WRONG = """\
name: another car
duration: 1
road: {track: straight, length_m: 100}
driver: {speed_kmh: 50}
vehicle:
  fmu: p.fmu
  parameters:
    Parrot.FailAt: -1
    Parrot.Chater: 1
  variables:
    Car.ax: {name: Car.Ax.x}
    Car.ay: {name: Car.ay, unit: g}
    Car.vx: {name: DM.Gas}
    Car.vy: {name: Car.vx}
    DM.Brake:
      name: Car.az
    Steer.WhlAng: {name: Temperature}
    Car.vFL: {name: Odd}
"""
MISSING = "the FMU has no variable for Car.YawRate [rad/s]; map it"
EXPECTED = (
    (8, 20, "Parrot.FailAt = -1 is below its least value 0"),
    (9, 5, "'p.fmu' has no parameter 'Parrot.Chater'; did you mean 'Parrot.Chatter'?"),
    (11, 20, "'p.fmu' has no variable 'Car.Ax.x'; did you mean 'Car.ax'?"),
    (12, 34, "the FMU declares 'Car.ay' in m/s2, not in g"),
    (13, 20, "'DM.Gas' is input; Car.vx needs output"),
    (14, 5, "unknown quantity 'Car.vy'; did you mean 'Car.vx'?"),
    (16, 13, "'Car.az' is output; DM.Brake needs input"),
    (17, 5, "'Temperature' is in K, which is no unit of Steer.WhlAng [rad]"),
    (18, 5, "the FMU does not define the unit knot of 'Odd': give scale, its factor to m/s"),
)


def complaints(version: int, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """First lines of what `cosim run` says of `WRONG`."""
    monkeypatch.chdir(folder)
    odd = Variable("Temperature", OUTPUT, unit="K"), Variable("Odd", OUTPUT, unit="knot")
    changed(Path("p.fmu"), version, *odd, without=["Car.YawRate"])
    Path("s.yaml").write_text(WRONG)
    result = CliRunner().invoke(main, ["run", "s.yaml"])
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    return [line for line in result.stderr.splitlines() if line.startswith("error: ")]


def test_everything_wrong_at_once_with_its_place(
    version: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = complaints(version, tmp_path, monkeypatch)
    missing = [line for line in lines if line.endswith(MISSING)]
    assert len(missing) == 1
    expected = [f"error: s.yaml:{line}:{column}: {words}" for line, column, words in EXPECTED]
    assert sorted(set(lines) - set(missing)) == sorted(expected)


def test_place_of_what_the_map_lacks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert f"error: s.yaml:10:3: {MISSING}" in complaints(3, tmp_path, monkeypatch)


def test_complaints_come_in_the_order_of_the_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = [int(line.split(":")[2]) for line in complaints(3, tmp_path, monkeypatch)]
    assert lines == sorted(lines)


RENAMED = {
    "Car.ax": "IMU.acc.x", "Car.ay": "IMU.acc.y", "Car.az": "IMU.acc.z", "Car.vx": "ESC.speed",
    "Car.CFL.q0p": "Susp.FL.rate", "Car.CFR.q0p": "Susp.FR.rate", "Car.CRL.q0p": "Susp.RL.rate",
    "Car.CRR.q0p": "Susp.RR.rate", "DM.Gas": "Pedal.gas", "DM.Steer.Ang": "Wheel.angle",
}  # fmt: skip


def renamed_vehicle(version: int, path: Path) -> str:
    """The vehicle FMU with other names; returns the map that a scenario needs."""

    def edit(root: ET.Element) -> None:
        variables = variables_of(root)
        for old, new in RENAMED.items():
            variables[old].set("name", new)

    repackage(builtin_fmu(version), path, edit)
    truth = {q.variable: q.name for q in TRUTH}
    entries = []
    for old, new in RENAMED.items():
        sign = ", scale: -1" if old in truth else ""
        entries.append(f"{truth.get(old, old)}: {{name: {new}{sign}}}")
    return "{" + ", ".join(entries) + "}"


def run(path: Path) -> Assembly:
    scenario = load(path)
    assembly = assemble(scenario, scenario.controllers[0], sensor=Blind())
    assembly.run(None)
    return assembly


def test_another_fmu_in_the_vehicles_place_gives_the_same_bits(
    version: int, tmp_path: Path
) -> None:
    """Closed loop over the driver, so that one wrong bit anywhere would grow."""
    obstacles = "{kind: bumps, height_m: 0.02, length_m: 0.5, spacing_m: 4}"
    own = run(write_scenario(tmp_path, duration="2", obstacles=obstacles))
    start = {
        "Road.File": f"'{own.files['road']}'",
        "Init.Velocity": str(50 / 3.6),
        "Damp.Passive": "true",
    }
    variables = renamed_vehicle(version, tmp_path / "other.fmu")
    parameters = "{" + ", ".join(f"{n}: {v}" for n, v in start.items()) + "}"
    vehicle = f"{{fmu: other.fmu, variables: {variables}, parameters: {parameters}}}"
    other = run(
        write_scenario(tmp_path, duration="2", obstacles=obstacles, sections={"vehicle": vehicle})
    )
    for group in ("channels", "truth", "driver", "vehicle"):
        np.testing.assert_array_equal(other.recorder.group(group), own.recorder.group(group))
    assert np.abs(own.recorder.group("truth")).max() > 0.05  # over bumps indeed
    csv = [a.recorder.write(tmp_path / n).read_bytes() for a, n in ((own, "a"), (other, "b"))]
    assert csv[0] == csv[1]


def test_a_vehicle_in_km_h_and_degrees(version: int, tmp_path: Path) -> None:
    """Its numbers are still SI, so what we make of them shows the conversion and nothing else."""
    factors = dict.fromkeys(SPEEDS, 1 / 3.6) | dict.fromkeys(ANGLES, math.pi / 180)

    def edit(root: ET.Element) -> None:
        definitions = root.find("UnitDefinitions")
        assert definitions is not None
        define_unit(definitions, "km/h", {"m": 1, "s": -1, "factor": 1 / 3.6})
        define_unit(definitions, "deg", {"rad": 1, "factor": math.pi / 180})
        for name in factors:
            set_unit(variables_of(root)[name], "km/h" if name in SPEEDS else "deg")

    foreign = repackage(builtin_fmu(version), tmp_path / "foreign.fmu", edit)
    wiring, problems = wire(foreign)
    assert not problems
    steer = 2 * math.pi / 180
    shown = drive(foreign, wiring, steer)
    plain = drive(builtin_fmu(version), own_wiring(), steer / factors["DM.Steer.Ang"])
    scale = np.array([factors.get(q.name, 1.0) for q in (*CHANNEL_QUANTITIES, *TRUTH, *POSE)])
    np.testing.assert_array_equal(shown, plain * scale)
    assert np.abs(plain[-1, [1, VX]]).min() > 0.1


def drive(fmu: Path, wiring: Wiring, steer: float) -> Array:
    """Half a second at 15 m/s with the steering wheel held; channels, truth and pose (50, 21)."""
    vehicle = Vehicle(Description(fmu), wiring, {"Init.Velocity": 15.0}, 0.01)
    vehicle.connect()
    rows = []
    for k in range(50):
        state = vehicle.read()
        rows.append(np.concatenate([state.channels, state.truth, state.pose]))
        vehicle.write(np.array([steer, 0.1, 0.0]), np.zeros(4))
        vehicle.step(k)
    vehicle.stop()
    return np.array(rows)


def test_quantities_have_a_name_each() -> None:
    assert len(QUANTITIES) == len(OUTPUT_QUANTITIES) + len(INPUT_QUANTITIES)
    assert [q.name for q in DRIVER] == ["DM.Steer.Ang", "DM.Gas", "DM.Brake"]
