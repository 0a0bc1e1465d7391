"""`cosim check` on FMUs that are only read: one mutant for each defect, named by its code."""

from __future__ import annotations

import contextlib
import io
import warnings
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from fmu_face import ROOT, build, package
from fmu_mutants import (
    MODEL,
    Edit,
    add_unit,
    change,
    entry,
    mutate,
    put,
    put_at,
    put_outer,
    typed,
    unit,
    variable,
    version_of,
)

from cosim.check.checker import check
from cosim.check.codes import CODES
from cosim.check.finding import Report
from cosim.errors import InputError

BINARY = {v: package.binary_path("lag", v, build.target_platform()) for v in (2, 3)}
TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
BUILD = "sources/buildDescription.xml"


@pytest.fixture
def mutant(fmus: dict[int, Path], version: int, tmp_path: Path) -> Callable[..., Report]:
    """Checks a mutant of the fixture without running it."""

    def make(**changes: object) -> Report:
        return check(mutate(fmus[version], tmp_path / "mutant.fmu", **changes), static=True)

    return make


def alone(report: Report, code: str, *words: str) -> None:
    """Assert that this code and no other was found, with all words in one of its messages."""
    assert report.codes == [code], [(f.code, f.message) for f in report.findings]
    said = [f"{f.where} {f.message}" for f in report.findings]
    assert any(all(word in text for word in words) for text in said), said


@pytest.mark.parametrize("name", ["vehicle", "lag"])
def test_sound_fmus_have_no_findings(fmus: dict[int, Path], version: int, name: str) -> None:
    shipped = ROOT / "cosim" / "fmus" / f"vehicle.fmi{version}.fmu"
    if name == "vehicle" and not shipped.is_file():
        pytest.skip("the vehicle FMUs are not built")
    report = check(shipped if name == "vehicle" else fmus[version], static=True)
    assert [(f.code, f.message) for f in report.findings] == []
    assert report.fmi_version == f"{version}.0"


def of_both(*edits: Edit) -> Edit:
    def edit(root: ET.Element) -> None:
        for one in edits:
            one(root)

    return edit


def copy_name(root: ET.Element) -> None:
    variable(root, "Lag.Gain").set("name", "Lag.Start")


def unlist_output(root: ET.Element) -> None:
    structure = entry(root, "ModelStructure")
    parent = structure.find("Outputs") if version_of(root) == 2 else structure
    assert parent is not None
    parent.remove(parent[0])


def unlist_unknown(root: ET.Element) -> None:
    structure = entry(root, "ModelStructure")
    parent = structure.find("InitialUnknowns") if version_of(root) == 2 else structure
    assert parent is not None
    parent.remove(next(e for e in parent if e.tag in ("Unknown", "InitialUnknown")))


def list_input(path2: str, tag3: str) -> Edit:
    def edit(root: ET.Element) -> None:
        structure = entry(root, "ModelStructure")
        if version_of(root) == 2:
            ET.SubElement(entry(structure, path2), "Unknown", index="1")
        else:
            place = [e.tag for e in structure].index(tag3)
            structure.insert(place, ET.Element(tag3, valueReference="0"))

    return edit


def stranger_in_structure(root: ET.Element) -> None:
    if version_of(root) == 2:
        entry(root, "ModelStructure/Outputs/Unknown").set("dependencies", "1 4711")
    else:
        entry(root, "ModelStructure/Output").set("dependencies", "0 4711")


def kinds_too_many(root: ET.Element) -> None:
    path = "Outputs/Unknown" if version_of(root) == 2 else "Output"
    element = entry(root, f"ModelStructure/{path}")
    first = "1" if version_of(root) == 2 else "0"
    change(element, dependencies=first, dependenciesKind="dependent dependent")


def twice_in_structure(root: ET.Element) -> None:
    structure = entry(root, "ModelStructure")
    parent = structure.find("Outputs") if version_of(root) == 2 else structure
    assert parent is not None
    parent.insert(0, ET.fromstring(ET.tostring(parent[0])))


def share_reference(root: ET.Element) -> None:
    """Of two units in FMI 2.0, where equal variables may share one."""
    variable(root, "Lag.Pressure").set("valueReference", "10")


def display_unit(name: str, factor: str | None = None, offset: str | None = None) -> Edit:
    def edit(root: ET.Element) -> None:
        element = ET.SubElement(unit(root, "rad"), "DisplayUnit", name=name)
        change(element, factor=factor, offset=offset)

    return edit


def kelvin(offset: str) -> Edit:
    def edit(root: ET.Element) -> None:
        element = ET.SubElement(entry(root, "UnitDefinitions"), "Unit", name="K")
        ET.SubElement(element, "BaseUnit", K="1")
        ET.SubElement(element, "DisplayUnit", name="degC", offset=offset)

    return edit


def bare_unit(root: ET.Element) -> None:
    ET.SubElement(entry(root, "UnitDefinitions"), "Unit", name="km/h")


def double_unit(root: ET.Element) -> None:
    entry(root, "UnitDefinitions").append(ET.fromstring(ET.tostring(unit(root, "bar"))))


def double_category(root: ET.Element) -> None:
    """The XSD of FMI 2.0 lets it pass."""
    ET.SubElement(entry(root, "LogCategories"), "Category", name="logGain")


def unknown_type(root: ET.Element) -> None:
    typed(root, "Lag.Start").set("declaredType", "Angle")


def second_time(root: ET.Element) -> None:
    for name in ("Lag.TimeFL", "Lag.TimeFR"):
        change(
            variable(root, name), causality="independent", variability="continuous", initial=None
        )
        change(typed(root, name), start=None)


def only_model_exchange(root: ET.Element) -> None:
    entry(root, "CoSimulation").tag = "ModelExchange"
    root[0].attrib = {"modelIdentifier": "lag"}


def no_state(root: ET.Element) -> None:
    spelling = "canGetAndSetFMUstate" if version_of(root) == 2 else "canGetAndSetFMUState"
    entry(root, "CoSimulation").set(spelling, "false")


def continuous_flag(root: ET.Element) -> None:
    variable(root, "Out.Above").set("variability", "continuous")


def no_token(root: ET.Element) -> None:
    root.set("guid" if version_of(root) == 2 else "instantiationToken", "")


def file_start(text: str) -> Edit:
    def edit(root: ET.Element) -> None:
        element = typed(root, "Gain.File")
        if version_of(root) == 3:
            element[0].set("value", text)
        else:
            element.set("start", text)

    return edit


EXPERIMENT = "DefaultExperiment"
XML_MUTANTS = [
    ("start-outside-range", put("In.u", start="20.0"), ["In.u", "20 rad", "-10 to 10 rad"]),
    ("start-outside-range", put("Lag.TimeRR", start="1e-9"), ["Lag.TimeRR", "0.001 to 100 s"]),
    ("min-above-max", put("Lag.TimeFL", min="100.0", max="0.1"), ["Lag.TimeFL", "100 s", "0.1 s"]),
    ("nominal-zero", put("Out.FL", nominal="0.0"), ["Out.FL"]),
    ("nominal-negative", put("Out.FL", nominal="-2.0"), ["Out.FL", "-2"]),
    ("not-finite", put("Lag.Pressure", start="NaN"), ["Lag.Pressure", "start"]),
    ("not-finite", put_at(EXPERIMENT, stopTime="INF"), ["stopTime", "inf"]),
    ("stop-before-start", put_at(EXPERIMENT, startTime="5.0"), ["stopTime 2 s", "startTime 5 s"]),
    ("step-not-positive", put_at(EXPERIMENT, stepSize="-0.1"), ["-0.1 s"]),
    ("step-not-positive", put_at(EXPERIMENT, stepSize="0"), ["0 s"]),
    ("step-beyond-stop", put_at(EXPERIMENT, stepSize="3.0"), ["3 s", "0 to 2 s"]),
    ("tolerance-not-positive", put_at(EXPERIMENT, tolerance="0"), ["tolerance is 0"]),
    ("unit-factor", add_unit("km/h", m="1", s="-1"), ["'km/h'", "0.27777", "factor of 3.6"]),
    ("unit-factor", add_unit("mm", m="1"), ["'mm'", "0.001", "factor of 1000"]),
    ("unit-factor", add_unit("kN", kg="1", m="1", s="-2"), ["'kN'", "factor of 1000"]),
    ("unit-factor", add_unit("%"), ["'%'", "0.01"]),
    ("unit-factor", add_unit("rpm", s="-1", factor="60"), ["'rpm'"]),
    ("unit-exponents", add_unit("N", kg="1", m="1", s="-1"), ["'N'", "kg m s^-1", "kg m s^-2"]),
    ("unit-offset", add_unit("degC", K="1", offset="-273.15"), ["'degC'", "273.15"]),
    ("unit-without-base", bare_unit, ["'km/h'"]),
    ("duplicate-unit", double_unit, ["'bar'"]),
    ("display-unit-factor", display_unit("mrad", "0.001"), ["'mrad'", "1000", "upside down"]),
    ("display-unit-factor", display_unit("rev", "1000"), ["'rev'", "0.159"]),
    ("display-unit-exponents", display_unit("N", "1.0"), ["'N'", "'rad'", "kg m s^-2"]),
    ("display-unit-offset", kelvin("273.15"), ["'degC'", "-273.15"]),
    ("unit-undefined", put("Lag.Start", unit="Rad"), ["Lag.Start", "'Rad'", "did you mean 'rad'"]),
    ("display-unit-undefined", put("In.u", displayUnit="grad"), ["In.u", "'grad'", "deg"]),
    ("unit-missing", put("In.u", unit=None, displayUnit=None), ["In.u"]),
    ("duplicate-name", copy_name, ["'Lag.Start'"]),
    ("variable-name", put_outer("Lag.Gain", name="Lag Gain"), ["'Lag Gain'"]),
    ("reference-conflict", share_reference, ["Lag.Gain", "Lag.Pressure", "10"]),
    ("start-missing", put("Lag.Gain", start=None), ["Lag.Gain"]),
    ("start-not-allowed", put("Out.FL", start="1.0"), ["Out.FL"]),
    ("illegal-combination", put_outer("Lag.Start", variability="discrete"), ["Lag.Start", "fixed"]),
    ("illegal-combination", continuous_flag, ["Out.Above", "Boolean"]),
    ("description-missing", put_outer("Lag.Gain", description=None), ["Lag.Gain"]),
    ("independent-variable", second_time, ["Lag.TimeFL", "Lag.TimeFR"]),
    ("structure-output-missing", unlist_output, ["Out.FL"]),
    ("structure-output-extra", list_input("Outputs", "Output"), ["In.u", "input"]),
    ("structure-initial-unknown-missing", unlist_unknown, ["Out.FL"]),
    ("structure-initial-unknown-extra", list_input("InitialUnknowns", "InitialUnknown"), ["In.u"]),
    ("structure-unknown-variable", stranger_in_structure, ["Out.FL", "4711"]),
    ("structure-dependencies", kinds_too_many, ["2 dependenciesKind for 1"]),
    ("structure-duplicate", twice_in_structure, ["Out.FL"]),
    ("not-co-simulation", only_model_exchange, ["ModelExchange"]),
    ("model-identifier", put_at("CoSimulation", modelIdentifier="9 lag"), ["'9 lag'"]),
    ("capability-contradiction", no_state, ["canSerializeFMU", "canGetAndSetFMU"]),
    ("duplicate-category", double_category, ["'logGain'"]),
    ("token-empty", no_token, ["is empty"]),
    ("resource-missing", file_start("gain.csv"), ["Gain.File", "'gain.csv'", "'gain.txt'"]),
    ("absolute-path", file_start("C:\\data\\gain.txt"), ["Gain.File", "C:\\data"]),
    ("wrong-case", file_start("Gain.TXT"), ["Gain.File", "'resources/gain.txt'"]),
]  # fmt: skip
ALSO = {  # where the standard itself sees a second defect in the same slip
    ("duplicate-category", 2): {"schema"},
    ("duplicate-unit", 2): {"schema"},
    ("token-empty", 2): set(),
    ("not-co-simulation", 2): {"schema"},
    ("model-identifier", 2): {"binary-name"},
    ("model-identifier", 3): {"binary-name", "build-identifier"},
}


@pytest.mark.parametrize(
    ("code", "edit", "words"), XML_MUTANTS, ids=[f"{m[0]}{i}" for i, m in enumerate(XML_MUTANTS)]
)
def test_a_defect_of_the_xml_is_named(
    mutant: Callable[..., Report], version: int, code: str, edit: Edit, words: list[str]
) -> None:
    report = mutant(edits={MODEL: edit})
    report.findings = [f for f in report.findings if f.code not in ALSO.get((code, version), ())]
    alone(report, code, *words)


def test_exact_line_of_a_finding(mutant: Callable[..., Report], fmus: dict[int, Path]) -> None:
    report = mutant(edits={MODEL: put("Lag.TimeRR", start="1e-9")})
    mutated = report.path
    with zipfile.ZipFile(mutated) as archive:
        lines = archive.read(MODEL).decode().splitlines()
    number = int(report.findings[0].where.rpartition(":")[2])
    assert "Lag.TimeRR" in lines[number - 1]


def rename_attribute(root: ET.Element) -> None:
    variable(root, "In.u").set("causalty", "input")


def test_the_schema_is_a_source_of_findings(mutant: Callable[..., Report]) -> None:
    alone(mutant(edits={MODEL: rename_attribute}), "schema", "causalty", f"{MODEL}:")


def test_xml_that_is_none(mutant: Callable[..., Report]) -> None:
    broken = b'<?xml version="1.0"?>\n<fmiModelDescription>\n<Oops>\n</fmiModelDescription>'
    alone(mutant(files={MODEL: broken}), "xml-syntax", f"{MODEL}:4", "Oops")


def test_two_defects_are_both_found(mutant: Callable[..., Report]) -> None:
    both = of_both(put("In.u", start="20.0"), add_unit("mm", m="1"))
    assert mutant(edits={MODEL: both}).codes == ["start-outside-range", "unit-factor"]


# ---------------------------------------------------------------- names in the archive


def test_the_archive_is_what_it_must_be(mutant: Callable[..., Report], version: int) -> None:
    where = BINARY[version]
    folder = where.split("/")[1]
    for code, changes, words in (
        ("unsafe-path", {"files": {"../evil.txt": b""}}, ["'../evil.txt'"]),
        ("unsafe-path", {"files": {"/etc/evil": b""}}, ["'/etc/evil'"]),
        ("unsafe-path", {"files": {"resources/../../evil": b""}}, ["evil"]),
        ("unsafe-path", {"files": {"C:/evil": b""}}, ["'C:/evil'"]),
        ("case-collision", {"files": {"resources/GAIN.txt": b""}}, ["GAIN.txt", "gain.txt"]),
        ("wrong-case", {"renamed": {"resources/": "Resources/"}}, ["'Resources'", "'resources'"]),
        ("wrong-case", {"renamed": {MODEL: "ModelDescription.xml"}}, ["'ModelDescription.xml'"]),
        ("wrong-case", {"renamed": {where: where.replace("lag", "Lag")}}, ["Lag.so", where]),
        ("wrong-case", {"renamed": {f"binaries/{folder}": f"binaries/{folder.upper()}"}},
         [folder.upper(), f"'{folder}'"]),
        ("wrong-case", {"renamed": {"sources/lag.c": "sources/LAG.c"}}, ["'lag.c'", "'LAG.c'"]),
        ("source-missing", {"files": {"sources/lag.c": None}}, ["'lag.c'"]),
        ("no-model-description", {"files": {MODEL: None}}, ["no modelDescription.xml"]),
        ("platform-unknown", {"files": {"binaries/amiga/lag.so": b""}}, ["'amiga'"]),
        ("binary-name", {"renamed": {where: where.replace("lag", "gal")}}, [where, "gal.so"]),
    ):  # fmt: skip
        alone(mutant(**changes), code, *words)


def test_a_folder_that_was_zipped_with_its_name(mutant: Callable[..., Report]) -> None:
    report = mutant(renamed={"": "lag/"})
    assert "no-model-description" in report.codes
    assert "zip the content of that folder" in str(report.as_json())


def test_backslashes_and_doubled_entries(
    fmus: dict[int, Path], version: int, tmp_path: Path
) -> None:
    path = mutate(fmus[version], tmp_path / "a.fmu")
    with warnings.catch_warnings(), zipfile.ZipFile(path, "a") as archive:
        warnings.simplefilter("ignore")  # zipfile warns of the very thing
        archive.writestr("resources/gain.txt", b"3\n")
    alone(check(path, static=True), "duplicate-entry", "gain.txt", "2 times")
    path = mutate(fmus[version], tmp_path / "b.fmu")
    name = zipfile.ZipInfo("resources/map.txt")
    name.filename = "resources\\map.txt"
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(name, b"3\n")
    alone(check(path, static=True), "backslash-path", "resources\\map.txt")


def test_a_damaged_entry(fmus: dict[int, Path], version: int, tmp_path: Path) -> None:
    path = mutate(fmus[version], tmp_path / "a.fmu")
    with zipfile.ZipFile(path) as archive:
        info = archive.getinfo("documentation/index.html")
    data = bytearray(path.read_bytes())
    middle = info.header_offset + 60 + info.compress_size // 2
    data[middle : middle + 8] = bytes(255 - b for b in data[middle : middle + 8])
    path.write_bytes(bytes(data))
    alone(check(path, static=True), "archive-damaged", "documentation/index.html")


def test_a_compression_that_other_tools_cannot_read(
    fmus: dict[int, Path], version: int, tmp_path: Path
) -> None:
    path = mutate(fmus[version], tmp_path / "a.fmu")
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("resources/map.txt", b"3\n" * 99, zipfile.ZIP_BZIP2)
    alone(check(path, static=True), "compression", "resources/map.txt", "bzip2")


# ---------------------------------------------------------------- files of FMI 3.0


@pytest.fixture
def mutant3(fmus: dict[int, Path], tmp_path: Path) -> Callable[..., Report]:
    def make(**changes: object) -> Report:
        return check(mutate(fmus[3], tmp_path / "mutant.fmu", **changes), static=True)

    return make


def test_terminals(mutant3: Callable[..., Report]) -> None:
    member = "Terminals/Terminal/TerminalMemberVariable"

    def twin(root: ET.Element) -> None:
        parent = entry(root, "Terminals")
        parent.append(ET.fromstring(ET.tostring(parent[0])))

    report = mutant3(edits={TERMINALS: put_at(member, variableName="Out.Fl")})
    alone(report, "terminal-variable", "'Out.Fl'", "did you mean 'Out.FL'", f"{TERMINALS}:")
    report = mutant3(edits={TERMINALS: put_at(member, memberName="Out.FR")})
    alone(report, "terminal-duplicate", "'Out.FR'")
    alone(mutant3(edits={TERMINALS: twin}), "terminal-duplicate", "2 of the terminals")
    alone(mutant3(files={TERMINALS: b"<no"}), "xml-syntax", TERMINALS)
    report = mutant3(edits={TERMINALS: put_at("Terminals/Terminal", colour="red")})
    alone(report, "schema", "colour")
    report = mutant3(renamed={TERMINALS: "terminalsAndIcons/TerminalsAndIcons.xml"})
    alone(report, "wrong-case", TERMINALS)


def test_icons(mutant3: Callable[..., Report]) -> None:
    xml = (
        b'<fmiTerminalsAndIcons fmiVersion="3.0"><GraphicalRepresentation><CoordinateSystem'
        b' x1="0" y1="0" x2="1" y2="1" suggestedScalingFactorTo_mm="1"/>'
        b'<Icon x1="0" y1="0" x2="1" y2="1" iconBaseName="logo"/></GraphicalRepresentation>'
        b"</fmiTerminalsAndIcons>"
    )
    report = mutant3(files={TERMINALS: xml})
    said = [f.message for f in report.findings if f.code == "icon-missing"]
    assert said == ["the icon 'terminalsAndIcons/logo.png' is missing"]


def test_build_description(mutant3: Callable[..., Report]) -> None:
    report = mutant3(edits={BUILD: put_at("BuildConfiguration", modelIdentifier="gal")})
    alone(report, "build-identifier", "'gal'", "lag")
    alone(mutant3(files={BUILD: None}), "build-description-missing", "C files")
    source = "BuildConfiguration/SourceFileSet/SourceFile"
    report = mutant3(edits={BUILD: put_at(source, name="fmi4.c")})
    alone(report, "source-missing", "'fmi4.c'", "did you mean 'fmi3.c'")


def test_arrays_have_as_many_starts_as_elements(mutant3: Callable[..., Report]) -> None:
    def edit(root: ET.Element) -> None:
        element = variable(root, "Lag.Start")
        ET.SubElement(element, "Dimension", start="3")
        element.set("start", "0 1")

    alone(mutant3(edits={MODEL: edit}), "start-count", "Lag.Start", "2 start values for 3")


# ---------------------------------------------------------------- what is no FMU


def test_files_that_are_no_fmus(tmp_path: Path, fmus: dict[int, Path]) -> None:
    (tmp_path / "text.fmu").write_text("hello")
    cut = tmp_path / "cut.fmu"
    cut.write_bytes(fmus[2].read_bytes()[:3000])
    for path, words in (
        (tmp_path / "none.fmu", "no such file"),
        (tmp_path, "is a folder"),
        (tmp_path / "text.fmu", "not a ZIP archive"),
        (cut, "not a ZIP archive"),
    ):
        with pytest.raises(InputError, match=words):
            check(path)
    old = mutate(fmus[2], tmp_path / "old.fmu", {MODEL: lambda root: root.set("fmiVersion", "1.0")})
    with pytest.raises(InputError, match=r"of FMI 1\.0; this checker reads FMI 2\.0 and 3\.0"):
        check(old)


def test_every_code_is_a_word_and_has_a_meaning() -> None:
    for code, what in CODES.items():
        assert code == code.lower()
        assert " " not in code
        assert what.meaning


def test_arbitrary_bytes_never_crash_the_checker(tmp_path: Path, fmus: dict[int, Path]) -> None:
    """Any single byte of the XML may be wrong: a report or a sentence comes out."""
    with zipfile.ZipFile(fmus[3]) as archive:
        xml = bytearray(archive.read(MODEL))
    for at in range(0, len(xml), 211):
        broken = bytes(xml[:at]) + b"9" + bytes(xml[at + 1 :])
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            archive.writestr(MODEL, broken)
        path = tmp_path / "broken.fmu"
        path.write_bytes(buffer.getvalue())
        with contextlib.suppress(InputError):  # another FMI version
            assert check(path, static=True).path == path
