"""The build of the FMUs (fmu/build.py), on a small model."""

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu
from fmu_face import FIXTURE, ROOT, build, describe, generate, package, toolchain, variables


def run_build(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROOT / "fmu" / "build.py"), *arguments]
    environment = {**os.environ, **environment}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def copy_fixture(folder: Path, old: str = "", new: str = "") -> Path:
    """A copy of the fixture model with a change to its table."""
    model = folder / "model"
    shutil.copytree(FIXTURE, model)
    table = (model / "variables.toml").read_text(encoding="utf-8")
    assert old in table
    (model / "variables.toml").write_text(table.replace(old, new, 1), encoding="utf-8")
    return model


def test_descriptions_are_valid(fmus: dict[int, Path], version: int) -> None:
    assert validate_fmu(str(fmus[version])) == []


def test_the_semantic_checks_of_another_tool_pass(fmus: dict[int, Path], version: int) -> None:
    tool = shutil.which("fmutool", path=str(Path(sys.executable).parent))
    if tool is None:
        pytest.skip("needs fmutool")
    command = [tool, "-input", str(fmus[version]), "-check"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    output = result.stdout + result.stderr
    assert "No semantic error" in output
    assert "ERROR" not in output


def test_units_have_si_exponents_factors_and_display_units(
    fmus: dict[int, Path], version: int
) -> None:
    description = fmpy.read_model_description(str(fmus[version]))
    units = {unit.name: unit for unit in description.unitDefinitions}
    pressure = units["bar"].baseUnit
    assert (pressure.kg, pressure.m, pressure.s, pressure.factor) == (1, -1, -2, 1e5)
    assert units["rad"].displayUnits[0].name == "deg"
    assert float(units["rad"].displayUnits[0].factor) == pytest.approx(57.29577951308232)
    assert {v.unit for v in description.modelVariables if v.unit} <= set(units)


def test_variables_are_described(fmus: dict[int, Path], version: int) -> None:
    description = fmpy.read_model_description(str(fmus[version]))
    by_name = {v.name: v for v in description.modelVariables}
    assert all(v.description for v in description.modelVariables)
    times = [float(by_name[f"Lag.Time{corner}"].start) for corner in ("FL", "FR", "RL", "RR")]
    assert times == [0.5, 0.5, 1.0, 2.0]
    assert by_name["Lag.TimeRL"].description == "Time constant RL"
    assert float(by_name["Lag.Gain"].max) == 5.0
    assert by_name["Lag.Gain"].variability == "tunable"
    assert by_name["Gain.File"].start == ""
    assert description.defaultExperiment.stepSize == "0.1"


def test_outputs_depend_on_no_input_directly(fmus: dict[int, Path], version: int) -> None:
    description = fmpy.read_model_description(str(fmus[version]))
    assert len(description.outputs) == 6
    assert all(unknown.dependencies == [] for unknown in description.outputs)


def described(model: Path, version: int, folder: Path) -> Path:
    """A folder with the model description of a table, without the FMU's other files."""
    table = variables.read_table(model / "variables.toml")
    xml = (
        describe.fmi2(table, "1", "{t}", ["lag.c"])
        if version == 2
        else describe.fmi3(table, "1", "{t}")
    )
    folder.mkdir()
    (folder / "modelDescription.xml").write_bytes(xml)
    return folder


def test_outputs_at_the_start_depend_on_what_the_table_says(
    fmus: dict[int, Path], version: int, tmp_path: Path
) -> None:
    unknowns = fmpy.read_model_description(str(fmus[version])).initialUnknowns
    on = {u.variable.name: [v.name for v in u.dependencies] for u in unknowns}
    assert on["Out.FL"] == on["Out.RR"] == ["Lag.Start", "Lag.Saturate"]
    assert (on["Out.Above"], on["Out.Resources"]) == (["Lag.Start"], [])
    text = (FIXTURE / "variables.toml").read_text(encoding="utf-8")
    said = text[text.index("[initial]") : text.index("[terminals.Response]")]
    silent = copy_fixture(tmp_path, said, "")
    folder = described(silent, version, tmp_path / "silent")
    unknowns = fmpy.read_model_description(str(folder)).initialUnknowns
    assert all(u.dependencies is None for u in unknowns)  # an importer has to assume all


TYPES = """[types]
Ratio = { unit = "1" }
Duration = { unit = "s", nominal = 0.5 }
Angle = { unit = "rad" }
Pressure = { unit = "bar" }

[terminals.Response]"""


def test_types_give_quantity_unit_and_nominal(version: int, tmp_path: Path) -> None:
    model = copy_fixture(tmp_path, "[terminals.Response]", TYPES)
    folder = described(model, version, tmp_path / "typed")
    assert validate_fmu(str(folder)) == []
    by_name = {v.name: v for v in fmpy.read_model_description(str(folder)).modelVariables}
    declared = by_name["Lag.TimeRL"].declaredType
    assert (declared.name, declared.quantity, declared.unit) == ("Duration", "Duration", "s")
    assert float(declared.nominal) == 0.5
    assert by_name["time"].declaredType is declared
    assert by_name["In.Hold"].declaredType is None


def test_capabilities_are_those_of_the_ceremony(fmus: dict[int, Path], version: int) -> None:
    simulation = fmpy.read_model_description(str(fmus[version])).coSimulation
    assert simulation.canGetAndSetFMUstate
    assert simulation.canSerializeFMUstate
    assert simulation.canHandleVariableCommunicationStepSize
    assert not simulation.canBeInstantiatedOnlyOncePerProcess
    assert not simulation.providesDirectionalDerivative


@pytest.mark.skipif(not shutil.which("nm"), reason="needs nm")
def test_every_symbol_of_the_standard_and_no_other(
    fmus: dict[int, Path], version: int, tmp_path: Path
) -> None:
    headers = toolchain.header_directory() / f"fmi{version}Functions.h"
    text = headers.read_text(encoding="utf-8")
    standard = set(re.findall(rf"^#define (fmi{version}\w+) +fmi{version}FullName", text, re.M))
    path = package.binary_path("lag", version, build.target_platform())
    with zipfile.ZipFile(fmus[version]) as archive:
        binary = archive.extract(path, tmp_path)
    listing = subprocess.run(
        ["nm", "-D", "--defined-only", binary], capture_output=True, text=True, check=True
    ).stdout
    assert {line.split()[-1] for line in listing.splitlines()} == standard


def test_the_build_is_deterministic(fmus: dict[int, Path], version: int, tmp_path: Path) -> None:
    again = build.build(FIXTURE, tmp_path / "elsewhere")[version - 2]
    assert again.read_bytes() == fmus[version].read_bytes()


def test_the_token_follows_table_and_sources(tmp_path: Path) -> None:
    token = package.instantiation_token(FIXTURE)
    assert re.fullmatch(r"\{[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\}", token)
    other = copy_fixture(tmp_path, "Gain of all lags", "Gain of every lag")
    assert package.instantiation_token(other) != token


def test_contents(fmus: dict[int, Path], version: int) -> None:
    with zipfile.ZipFile(fmus[version]) as archive:
        names = set(archive.namelist())
        page = archive.read("documentation/index.html").decode()
        assert {info.compress_type for info in archive.infolist()} == {zipfile.ZIP_DEFLATED}
        assert {info.extract_version for info in archive.infolist()} == {20}
    assert {"sources/lag.c", "sources/variables.c", "resources/gain.txt"} <= names
    assert {"sources/buildDescription.xml", "documentation/licenses/license.txt"} <= names
    assert f"sources/fmi{5 - version}.c" not in names
    assert "First-order lags with gains &amp; &lt;limits&gt;" in page
    assert "<td>Lag.TimeRR</td>" in page
    assert not any(name.startswith("extra/org.fmi-standard") for name in names)


def test_terminals_name_variables(fmus: dict[int, Path], version: int) -> None:
    with zipfile.ZipFile(fmus[version]) as archive:
        root = ET.fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml"))
    terminal = root.find("Terminals/Terminal")
    assert terminal is not None
    assert terminal.get("name") == "Response"
    assert [m.get("variableName") for m in terminal][:2] == ["Out.FL", "Out.FR"]


def test_no_compiler_is_one_sentence(tmp_path: Path) -> None:
    arguments = ("--model", str(FIXTURE), "--out", str(tmp_path))
    result = run_build(*arguments, PATH=str(tmp_path), CC="")
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert "apt install gcc" in result.stderr
    result = run_build(*arguments, CC="no-such-compiler")
    assert result.returncode == 2
    assert "'no-such-compiler' was not found" in result.stderr


def test_a_compile_error_is_shown(tmp_path: Path) -> None:
    model = copy_fixture(tmp_path)
    (model / "lag.c").write_text('#include "model.h"\nint broken(void) { return }\n')
    result = run_build("--model", str(model), "--out", str(tmp_path))
    assert result.returncode == 2
    assert "lag.c:2" in result.stderr
    assert "Traceback" not in result.stderr


def test_an_unknown_model_is_named(tmp_path: Path) -> None:
    result = run_build("--model", "vehicel", "--out", str(tmp_path))
    assert result.returncode == 2
    assert "There is no model 'vehicel'" in result.stderr


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("start=1.0, min=0.0", "start=-1.0, min=0.0", "Lag.Gain: start -1.0 1 is outside 0.0 to"),
        ("min=0.001, max=100.0", "min=200.0, max=100.0", "min 200.0 is above max 100.0"),
        ('unit="bar"', 'unit="psi"', "Lag.Pressure: unit 'psi' is not defined"),
        ('display="ms"', 'display="h"', "display unit 'h' is not one of unit 's'"),
        ("start=[0.5, 0.5, 1.0, 2.0]", "start=[0.5, 0.5]", "2 start values for 4 variables"),
        ('type="Boolean", start=true', 'type="Boolean", start=1.5', "1.5 is not of type Boolean"),
        ('variability="tunable"', 'variability="discrete"', "variability 'discrete'"),
        ('name="Lag.Start"', 'name="Lag.Gain"', "Lag.Gain: this name appears twice"),
        ("nominal=2.0", "nomimal=2.0", "unknown key 'nomimal'"),
        ('"Out.RR"]', '"Out.XX"]', "terminal 'Response': there is no variable 'Out.XX'"),
        ("[terminals.Response]", TYPES.replace("rad", "bar"), "bar: this unit of a type appears"),
        ("[terminals.Response]", TYPES.replace("rad", "deg"), "unit 'rad': no type in [types] has"),
        ("[terminals.Response]", TYPES.replace("rad", "deg"), "type 'Angle': unit 'deg' is not"),
        ("[terminals.Response]", TYPES.replace("Angle", '"Lag.Gain"'), "Lag.Gain: this name appe"),
        ('nothing = ["Out.Resources"]', 'nothing = ["Out.XX"]', "there is no output 'Out.XX'"),
        ('without = ["In.u"', 'without = ["In.x"', "[initial]: 'In.x' cannot be set"),
        ('nothing = ["Out.R', 'nought = ["Out.R', "[initial]: unknown key 'nought'"),
    ],
)
def test_mistakes_in_the_table_are_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    model = copy_fixture(tmp_path, old, new)
    with pytest.raises(variables.TableError, match=re.escape(message)):
        variables.read_table(model / "variables.toml")


def test_all_mistakes_come_at_once(tmp_path: Path) -> None:
    model = copy_fixture(tmp_path, 'unit="bar"', 'unit="psi", nominel=1.0')
    result = run_build("--model", str(model), "--out", str(tmp_path))
    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 2


def test_c_names() -> None:
    assert variables.field_name("Car.C@.q0") == "Car_C_q0"
    assert variables.field_name("Car.WheelSpd_@") == "Car_WheelSpd"
    assert generate.quote('a"b\\ü?') == '"a\\042b\\134\\303\\274\\077"'
