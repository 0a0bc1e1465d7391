"""`cosim inspect`: what a file is, and what is inside FMUs, networks, scenarios and roads."""

from __future__ import annotations

import hashlib
import json
import zipfile
from pathlib import Path

import numpy as np
import onnx
import onnxruntime as ort
import pytest
from click.testing import CliRunner, Result
from fmu_face import ROOT, build, package
from fmu_mutants import MODEL, add_unit, mutate, put, typed, variable

from cosim.cli import main
from cosim.errors import InputError
from cosim.inspect.command import ROWS, inspect
from cosim.inspect.facts import size_of
from cosim.inspect.kind import recognise
from sensor.channels import CHANNEL_NAMES
from sensor.packed.onnx_file import OnnxError, read_onnx

NETWORK = ROOT / "sensor" / "models" / "bilstm_w19_ideal.onnx"
VEHICLE = ROOT / "cosim" / "fmus" / "vehicle.fmi3.fmu"
needs_vehicle = pytest.mark.skipif(not VEHICLE.is_file(), reason="the vehicle FMUs are not built")


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def lag(fmus: dict[int, Path], request: pytest.FixtureRequest) -> Path:
    return fmus[request.param]


def typed_in(*words: object) -> Result:
    return CliRunner().invoke(main, ["inspect", *map(str, words)])


# ---------------------------------------------------------------- kinds


def test_each_kind_is_told_by_its_content(lag: Path, tmp_path: Path) -> None:
    """Whatever a file is called."""
    road = tmp_path / "road.txt"
    road.write_text("$CT\nsome road\n$\n$ROAD_CRG\n")
    for source, kind in ((lag, "fmu"), (NETWORK, "network"), (road, "road")):
        other = tmp_path / "thing.dat"
        other.write_bytes(source.read_bytes())
        assert recognise(other) == kind
    scenario = tmp_path / "a.yaml"
    scenario.write_text("name: a\nroad: {track: rural}\n")
    assert recognise(scenario) == "scenario"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.json", b'{"a": 1}', "looks like JSON"),
        ("a.csv", b"t,x\n0,1\n", "a table of numbers (CSV)"),
        ("a.toml", b"[model]\n", "a TOML file"),
        ("a.parquet", b"PAR1\0\0", "a Parquet file"),
        ("a.xml", b"<?xml?><fmiModelDescription/>", "the model description of an FMU"),
        ("a.html", b"<html></html>", "XML or HTML"),
        ("a.txt", b"", "an empty file"),
        ("a.bin", b"\0\1\2\3", "binary data"),
        ("a.so", b"\x7fELF$ROAD_CRG", "a program or library"),
        ("a.yaml", b"name: x\nruns: [a]\n", "a recipe of a data set (cosim sensor dataset)"),
        ("a.yaml", b"name: x\ntraining: {}\nruns: {}\n", "a training recipe"),
        ("a.yaml", b"name: x\nloads: []\n", "a variant of the vehicle"),
    ],
)
def test_other_files_get_a_sentence(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    (tmp_path / name).write_bytes(content)
    result = typed_in(tmp_path / name)
    assert result.exit_code == 2
    assert words in result.stderr
    assert "not an FMU, an ONNX network, a scenario (YAML) or an OpenCRG road" in result.stderr


def test_other_archives_get_a_sentence(tmp_path: Path) -> None:
    for member, words in (
        ("SystemStructure.ssd", "an OpenCRG road; unzip it and inspect the FMUs in resources/"),
        ("[Content_Types].xml", "an Office document"),
        ("a.txt", "a ZIP archive without modelDescription.xml"),
    ):
        with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
            archive.writestr(member, "x")
        with pytest.raises(InputError, match="looks like") as caught:
            recognise(tmp_path / "a.zip")
        assert words in str(caught.value)
    (tmp_path / "cut.fmu").write_bytes((tmp_path / "a.zip").read_bytes()[:20])
    with pytest.raises(InputError, match="cut short"):
        recognise(tmp_path / "cut.fmu")


def test_the_nearest_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "bumpy_lap.yaml").write_text("name: a\n")
    (tmp_path / "bumpy_lap.json").write_text("{}")
    for asked in ("bumpy_lop.yaml", "bumpy_lap.json", ""):
        with pytest.raises(InputError, match="did you mean"):
            recognise(tmp_path / asked)
    (tmp_path / MODEL).write_text("<fmiModelDescription/>")
    with pytest.raises(InputError, match="the folder of an unpacked FMU; zip its content"):
        recognise(tmp_path)


# ---------------------------------------------------------------- FMUs


def test_an_fmu(lag: Path) -> None:
    facts = inspect(lag)
    d = facts.data
    version = d["fmi_version"][0]
    assert (d["model_name"], d["model_identifier"], d["license"]) == ("Lag", "lag", "MIT")
    place = package.binary_path("lag", int(version), build.target_platform())
    assert d["platforms"] == [place.split("/")[1]]
    assert d["counts"]["parameter"] == 9
    assert (d["counts"]["input"], d["counts"]["output"]) == (2, 6)
    by_name = {v["name"]: v for v in d["variables"]}
    assert by_name["In.u"] | {"value_reference": 0} == by_name["In.u"]
    assert (by_name["In.u"]["unit"], by_name["In.u"]["start"]) == ("rad", "1.0")
    assert (by_name["In.u"]["min"], by_name["In.u"]["max"]) == (-10.0, 10.0)
    assert d["default_experiment"]["stepSize"] == "0.1"
    assert d["licences"] == ["documentation/licenses/license.txt"]
    with zipfile.ZipFile(lag) as archive:
        sizes = sum(i.file_size for i in archive.infolist() if i.filename.startswith("sources/"))
    assert d["folders"]["sources"] == sizes
    assert sum(d["folders"].values()) > sizes
    if version == "3":
        assert d["terminals"][0]["members"] == ["Out.FL", "Out.FR", "Out.RL", "Out.RR"]
    assert d["serves"]["sensor channels"]["Car.ax"].startswith("missing")


def test_an_fmu_on_paper(lag: Path) -> None:
    out = typed_in(lag).stdout
    for words in ("default experiment  start 0.0 s, stop 2.0 s, step 0.1 s", "Inputs", "In.u",
                  "rad", "sensor channels", "0 of 14", "MIT"):  # fmt: skip
        assert words in out
    assert json.loads(typed_in(lag, "--json").stdout)["kind"] == "fmu"


@needs_vehicle
def test_long_lists_end_unless_all_is_asked_for() -> None:
    short, long = typed_in(VEHICLE).stdout, typed_in(VEHICLE, "--all").stdout
    count = inspect(VEHICLE).data["counts"]["output"]
    assert f"and {count - ROWS} more; --all shows them" in short
    assert "--all shows them" not in long
    assert len(long.splitlines()) > len(short.splitlines()) + 200


@needs_vehicle
def test_the_vehicle_serves_everything() -> None:
    for group, answers in inspect(VEHICLE).data["serves"].items():
        assert set(answers.values()) == {"yes"}, group
    assert set(inspect(VEHICLE).data["serves"]["sensor channels"]) == set(CHANNEL_NAMES)


def test_quantities_of_another_unit_kind_or_causality(fmus: dict[int, Path], tmp_path: Path):
    def rename(name: str, unit: str) -> None:
        def edit(root) -> None:
            add_unit("km/h", m="1", s="-1", factor="0.2777777777777778")(root)
            variable(root, "Out.FL").set("name", name)
            typed(root, name).attrib.pop("displayUnit")
            put(name, unit=unit)(root)

        path = mutate(fmus[2], tmp_path / "m.fmu", {MODEL: edit})
        facts = inspect(path)
        return facts.data["serves"]["sensor channels"], facts.notes

    answers, _ = rename("Car.vx", "km/h")
    assert answers["Car.vx"] == "yes, converted from km/h"
    answers, notes = rename("Car.vx", "bar")
    assert answers["Car.vx"] == "of another kind: bar instead of m/s"
    assert any("Car.vx of another kind" in note for note in notes)
    assert "did you mean 'Car.vx'" in answers["Car.vy"] if "Car.vy" in answers else True


def test_fmus_that_cannot_be_read(fmus: dict[int, Path], tmp_path: Path) -> None:
    broken = mutate(fmus[3], tmp_path / "a.fmu", files={MODEL: b"<oops"})
    nested = mutate(fmus[3], tmp_path / "b.fmu", renamed={"": "lag/"})
    old = mutate(fmus[3], tmp_path / "c.fmu", {MODEL: lambda root: root.set("fmiVersion", "1.0")})
    for path, words in (
        (broken, "no well-formed XML"), (nested, "zip the content"), (old, "of FMI 1.0"),
    ):  # fmt: skip
        result = typed_in(path)
        assert result.exit_code == 2
        assert words in result.stderr


# ---------------------------------------------------------------- networks


def test_the_network_against_the_onnx_package() -> None:
    """The file is read without that package; here it is the oracle."""
    mine, theirs = read_onnx(NETWORK.read_bytes()), onnx.load(NETWORK)
    assert mine.ir_version == theirs.ir_version
    assert mine.opsets == {o.domain: o.version for o in theirs.opset_import}
    assert mine.metadata == {p.key: p.value for p in theirs.metadata_props}
    kinds = [node.op_type for node in theirs.graph.node]
    assert mine.operators == {kind: kinds.count(kind) for kind in kinds}
    shapes = {w.name: tuple(w.dims) for w in theirs.graph.initializer}
    assert {name: shape for name, (_, shape) in mine.weights.items()} == shapes
    session = ort.InferenceSession(NETWORK, providers=["CPUExecutionProvider"])
    assert [list(p.shape) for p in mine.inputs] == [p.shape for p in session.get_inputs()]
    assert [list(p.shape) for p in mine.outputs] == [p.shape for p in session.get_outputs()]
    floats = [w for w in theirs.graph.initializer if w.data_type == onnx.TensorProto.FLOAT]
    assert mine.parameters == sum(int(np.prod(w.dims)) for w in floats)


def test_a_network_on_paper() -> None:
    out = typed_in(NETWORK).stdout
    for words in ("batch x 19 x 14", "ai.onnx 17", "LSTM", "Car.YawRate", "rad/s", "VRel.RR",
                  "best validation rmse", "it fits the virtual sensor"):  # fmt: skip
        assert words in out
    assert json.loads(typed_in(NETWORK, "--json").stdout)["fits_the_sensor"] is True


def tiny(metadata: dict[str, str], shape: tuple[int | str, ...] = ("batch", 19, 14)) -> bytes:
    node = onnx.helper.make_node("Identity", ["a"], ["b"])
    ports = [onnx.helper.make_tensor_value_info(n, onnx.TensorProto.FLOAT, shape) for n in "ab"]
    graph = onnx.helper.make_graph([node], "g", ports[:1], ports[1:])
    model = onnx.helper.make_model(graph)
    onnx.helper.set_model_props(model, metadata)
    return model.SerializeToString()


def test_networks_of_others(tmp_path: Path) -> None:
    own = inspect(NETWORK).data["metadata"]["sensor"]
    swapped = json.loads(json.dumps(own))
    swapped["inputs"]["units"][3] = "deg/s"
    path = tmp_path / "n.onnx"
    for content, words in (
        (tiny({}), "no entry 'sensor'"),
        (tiny({"sensor": "not json"}), "no entry 'sensor'"),
        (tiny({"sensor": json.dumps(swapped)}), "'Car.RollVel' is in 'deg/s'"),
        (tiny({"sensor": json.dumps({**own, "sample_rate_hz": 50})}), "50 Hz, where 100 Hz"),
        (tiny({"sensor": json.dumps({**own, "outputs": {}})}), "lack or misspell 'names'"),
        (tiny({"sensor": json.dumps(own)}, (1, 7, 14)), "[[7, 14]]"),
    ):
        path.write_bytes(content)
        facts = inspect(path)
        assert facts.data["fits_the_sensor"] is False
        assert words in facts.notes[0]


def test_damaged_networks_are_refused(tmp_path: Path) -> None:
    content = NETWORK.read_bytes()
    for size in (1, 10, 1000, len(content) // 2, len(content) - 1):
        with pytest.raises(OnnxError):
            read_onnx(content[:size])
    (tmp_path / "a.onnx").write_bytes(content[:5000])
    result = typed_in(tmp_path / "a.onnx")
    assert (result.exit_code, "no ONNX model, or cut short" in result.stderr) == (2, True)


# ---------------------------------------------------------------- scenarios

SCENARIO = """\
name: a lap
road: {track: straight, length_m: 500, surface: smooth}
driver: {speed_kmh: 90}
vehicle: {parameters: {Body.Mass: 2600}}
seed: 7
controllers: [{kind: passive}, {kind: skyhook, gain_ns_per_m: 3000}]
limits: [{metric: passive.lap_time_s, max: 60}]
"""


@needs_vehicle
def test_a_scenario(tmp_path: Path) -> None:
    path = tmp_path / "lap.yaml"
    path.write_text(SCENARIO)
    facts = inspect(path)
    values = {v["path"]: v for v in facts.data["values"]}
    assert values["driver.speed_kmh"] == {
        "path": "driver.speed_kmh", "value": 90.0, "unit": "km/h", "origin": "given",
    }  # fmt: skip
    assert values["driver.style"]["origin"] == "default"
    assert values["sensor.estimator"]["value"] == "carried"
    assert values["sensor.condition"]["origin"] == "default"
    mass = values["vehicle.parameters.Body.Mass"]
    assert (mass["value"], mass["unit"], mass["origin"]) == (2600, "kg", "given")
    assert values["controllers.1.gain_ns_per_m"]["unit"] == "N s/m"
    assert values["controllers.1.feedback"]["origin"] == "default"
    assert facts.data["road"]["length_m"] == 500.0
    assert facts.data["expected_duration_s"] == pytest.approx(500 / 25, rel=0.01)
    assert facts.data["expected_samples"] == pytest.approx(2001, rel=0.01)
    assert [run["name"] for run in facts.data["runs"]] == ["passive", "skyhook_estimate"]
    files = {f["what"]: f for f in facts.data["files"]}
    assert set(files) >= {"scenario", "vehicle", "road", "sensor"}
    digest = hashlib.sha256(SCENARIO.encode()).hexdigest()
    assert files["scenario"]["sha256"] == digest
    out = typed_in(path).stdout
    assert "passive.lap_time_s" in out
    assert digest in out


@needs_vehicle
def test_a_scenario_with_variants_and_a_duration(tmp_path: Path) -> None:
    path = tmp_path / "lap.yaml"
    path.write_text(
        "name: a\nduration: 3\nvehicle: {variants: [worn_dampers]}\n"
        "road: {track: straight, length_m: 500, surface: A}\ndriver: {speed_kmh: 90}\n"
    )
    facts = inspect(path)
    values = facts.data["values"]
    assert any(v["origin"] == "variant worn_dampers" for v in values)
    seeds = {v["path"]: (v["value"], v["origin"]) for v in values if v["path"].endswith("seed")}
    assert seeds["road.surface.seed"] == (1, "from seed")
    assert facts.data["expected_duration_s"] == 3.0
    assert facts.data["expected_samples"] == 301


def test_a_wrong_scenario_gets_all_its_messages(tmp_path: Path) -> None:
    path = tmp_path / "lap.yaml"
    path.write_text("name: a\nroad: {track: hockenhiem}\ndriver: {style: fast}\n")
    result = typed_in(path)
    assert result.exit_code == 2
    assert f"{path}:2:" in result.stderr
    assert f"{path}:3:" in result.stderr


# ---------------------------------------------------------------- small things


@pytest.mark.parametrize(
    ("count", "text"),
    [
        (0, "0 B"),
        (1023, "1023 B"),
        (1024, "1.0 KiB"),
        (1 << 20, "1.0 MiB"),
        (3 << 41, "6144.0 GiB"),
    ],
)
def test_sizes(count: int, text: str) -> None:
    assert size_of(count) == text
