"""`cosim pack`: what it writes, and what it says of everything that can be wrong."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
import pytest
import shipped_fmus as fmus
from click.testing import CliRunner, Result
from fmu_face import ROOT, toolchain

from cosim.check.checker import check
from cosim.cli import main
from cosim.errors import NetworkError
from cosim.inspect.command import inspect
from cosim.pack.archive import write_fmu
from cosim.pack.packing import pack
from cosim.pack.platforms import PLATFORMS, cross_cache
from cosim.pack.template import read_template, token_of
from cosim.pack.trial import compare
from sensor.errors import SensorError
from sensor.estimators import MODELS
from sensor.packed import blob, read_network

SHIPPED = sorted(MODELS.glob("*.onnx"))


@pytest.fixture
def model() -> Path:
    return fmus.small_network(carried=False)


def typed_in(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["pack", *map(str, arguments)])


def entries(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


# ---------------------------------------------------------------- what it writes


@pytest.mark.parametrize("network", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_network_packs(network: Path, tmp_path: Path) -> None:
    """Run beside ONNX Runtime on the windowed or carried file itself."""
    packed = pack(network, tmp_path / "sensor.fmu")
    assert packed.difference < 1e-5
    assert network.name in packed.description


def test_the_command_says_what_it_has_written(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "sensor.fmu"
    for fmi in (2, 3):
        result = typed_in(model, "-o", out, "--fmi", fmi)
        assert result.exit_code == 0, result.output
        assert result.stdout == ""
        first, what, last = result.stderr.splitlines()
        assert first.startswith(f"{out}: FMI {fmi}.0, ")
        assert f"by the network {model.name}: LSTM over 19 samples" in what
        assert last.startswith(f"It differs from {model.name} by ")
        assert inspect(out).data["fmi_version"] == f"{fmi}.0"
    assert [path.name for path in tmp_path.iterdir()] == ["sensor.fmu"]


def test_the_same_network_gives_the_same_bytes(model: Path, tmp_path: Path) -> None:
    one, two = (pack(model, tmp_path / f"{name}.fmu").path.read_bytes() for name in "ab")
    assert one == two


def test_the_fmu_holds_the_network_and_its_record(model: Path, tmp_path: Path) -> None:
    files = entries(pack(model, tmp_path / "sensor.fmu").path)
    network = read_network(model)
    assert files["resources/network.bin"] == blob(network)
    record = json.loads(files["extra/org.suspension-cosim/network.json"])
    assert record["sha256"] == hashlib.sha256(model.read_bytes()).hexdigest()
    assert (record["kind"], record["window"], record["units"]) == ("windowed", fmus.WINDOW, 12)
    assert record["metadata"] == dict(network.metadata)
    page = files["documentation/index.html"].decode()
    assert f"<h1>Sensor {model.stem} " in page
    assert record["sha256"] in page
    assert "Car.SuspControl" not in page
    assert record["sha256"] in files["documentation/licenses/license.txt"].decode()


def test_each_network_has_a_token_of_its_own(tmp_path: Path) -> None:
    template = read_template(3)
    tokens = {token_of(template, blob(read_network(path))) for path in SHIPPED}
    assert len(tokens) == len(SHIPPED)
    assert {len(token) for token in tokens} == {len(template.token)}
    assert {token[:20] for token in tokens} == {template.token[:20]}


def test_inspect_shows_network_and_service(model: Path, tmp_path: Path) -> None:
    path = pack(model, tmp_path / "sensor.fmu").path
    facts = inspect(path)
    assert {answer for group in ("sensor channels", "estimates") for answer in
            facts.data["serves"][group].values()} == {"yes"}  # fmt: skip
    assert facts.data["network"]["file"] == model.name
    shown = CliRunner().invoke(main, ["inspect", str(path)]).stdout
    assert "Network" in shown
    assert "14 of 14" in shown
    assert "vehicle.variables" not in shown


@pytest.mark.parametrize("fmu", [fmus.Shipped("windowed", 2), fmus.Shipped("carried", 3)], ids=str)
def test_check_finds_nothing(fmu: fmus.Shipped) -> None:
    assert list(check(fmu.path).findings) == []


def test_it_needs_neither_torch_nor_the_onnx_package(model: Path, tmp_path: Path) -> None:
    program = (
        "import sys; sys.modules.update(dict.fromkeys(['torch', 'onnx']));"
        "from pathlib import Path; from cosim.pack.packing import pack;"
        f"print(pack(Path({str(model)!r}), Path({str(tmp_path / 'a.fmu')!r})).difference)"
    )
    said = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert float(said.stdout) < 1e-5


def test_a_network_for_one_window_at_a_time_packs(model: Path, tmp_path: Path) -> None:
    """What torch's exporters write unless they are told that the batch is open."""
    changed = onnx.load(model)
    for port in (*changed.graph.input, *changed.graph.output):
        port.type.tensor_type.shape.dim[0].dim_value = 1
    onnx.save(changed, tmp_path / "one.onnx")
    assert pack(tmp_path / "one.onnx", tmp_path / "sensor.fmu").difference < 1e-5


def test_a_network_that_does_not_run_is_refused_with_a_sentence(tmp_path: Path) -> None:
    """Its operators are this sensor's, but a state has not the shape that its port has."""
    changed = onnx.load(fmus.small_network(carried=True))
    for port in (*changed.graph.input, *changed.graph.output):
        if port.name in ("hidden", "next_hidden"):
            port.type.tensor_type.shape.dim[2].dim_value = 2
    onnx.save(changed, tmp_path / "odd.onnx")
    result = typed_in(tmp_path / "odd.onnx", "-o", tmp_path / "s.fmu")
    assert result.exit_code in (2, 3), result.output
    assert f"{tmp_path / 'odd.onnx'}: ONNX Runtime cannot " in result.stderr
    assert not (tmp_path / "s.fmu").exists()


def test_a_shape_that_does_not_fit_is_named_with_the_file(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sensor.packed.layout.MOST", 11)
    result = typed_in(model, "-o", tmp_path / "s.fmu")
    assert result.exit_code == 2
    assert f"{model}: it has 19 samples in a window, 12 units, " in result.stderr


def test_the_result_is_checked_before_it_is_written(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A network whose bytes are those of another one."""
    other = tmp_path / "other.onnx"
    changed = onnx.load(model)
    last = changed.graph.initializer[-1]
    values = onnx.numpy_helper.to_array(last)
    last.CopyFrom(onnx.numpy_helper.from_array(values + np.float32(0.01), last.name))
    onnx.save(changed, other)
    monkeypatch.setattr("cosim.pack.packing.read_network", lambda path: read_network(model))
    with pytest.raises(NetworkError, match="its estimates differ by"):
        pack(other, tmp_path / "sensor.fmu")
    assert not (tmp_path / "sensor.fmu").exists()


def test_another_window_is_noticed(tmp_path: Path) -> None:
    windowed, carried = (fmus.Shipped(f"small {kind}", 3) for kind in fmus.KINDS)
    with pytest.raises(NetworkError, match="it has estimates at other samples"):
        compare(windowed.path, carried.network, 1)


# ---------------------------------------------------------------- platforms


def fill_cache(platform: str, fmi: int, monkeypatch: pytest.MonkeyPatch, cache: Path) -> bytes:
    """Put an FMU where `make cross` would; returns its binary. No compiler: only places count."""
    monkeypatch.setenv("COSIM_CACHE_DIR", str(cache))
    folder = cross_cache(read_template(fmi).token, platform)
    folder.mkdir(parents=True)
    binary = b"for " + platform.encode()
    system = platform.partition("-")[2]
    suffix = {"windows": "dll", "darwin": "dylib"}.get(system, "so")
    name = {"windows": "win64", "darwin": "darwin64"}[system] if fmi == 2 else platform
    with zipfile.ZipFile(folder / f"sensor.fmi{fmi}.fmu", "w") as archive:
        archive.writestr(f"binaries/{name}/sensor.{suffix}", binary)
        archive.writestr("modelDescription.xml", "left alone")
    return binary


def test_binaries_of_other_platforms_come_from_the_cache(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    windows = fill_cache("x86_64-windows", 3, monkeypatch, tmp_path / "cache")
    result = typed_in(model, "-o", tmp_path / "s.fmu", "--platform", "x86_64-windows")
    assert result.exit_code == 0, result.output
    files = entries(tmp_path / "s.fmu")
    assert files["binaries/x86_64-windows/sensor.dll"] == windows
    assert len([name for name in files if name.startswith("binaries/")]) == 2
    assert b"left alone" not in files["modelDescription.xml"]
    fill_cache("x86_64-darwin", 2, monkeypatch, tmp_path / "cache")
    pack(model, tmp_path / "s.fmu", 2, ["x86_64-darwin"])
    assert "binaries/darwin64/sensor.dylib" in entries(tmp_path / "s.fmu")


def test_this_platform_need_not_be_compiled_again(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COSIM_CACHE_DIR", str(tmp_path / "empty"))
    own = toolchain.target_platform()
    assert pack(model, tmp_path / "s.fmu", 3, [own]).platforms == (own,)


def test_missing_binaries_are_named_in_one_sentence(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COSIM_CACHE_DIR", str(tmp_path / "empty"))
    result = typed_in(model, "-o", tmp_path / "s.fmu", "--platform", "all")
    assert result.exit_code == 2
    (said,) = result.stderr.splitlines()
    missing = ", ".join(p for p in PLATFORMS if p != toolchain.target_platform())
    assert said.startswith(f"error: no binary for {missing} in {tmp_path / 'empty'}")
    assert "run 'make cross'" in said
    assert not (tmp_path / "s.fmu").exists()


@pytest.mark.parametrize(
    ("fmi", "platform", "words"),
    [
        (3, "x86_64-window", "did you mean 'x86_64-windows'?"),
        (3, "amiga", "there is no platform 'amiga' among x86_64-linux, aarch64-linux,"),
        (2, "aarch64-linux", "FMI 2.0 has no name for platform 'aarch64-linux'; pack for FMI 3"),
    ],
)
def test_unknown_platforms(
    model: Path, tmp_path: Path, fmi: int, platform: str, words: str
) -> None:
    result = typed_in(model, "-o", tmp_path / "s.fmu", "--fmi", fmi, "--platform", platform)
    assert result.exit_code == 2
    assert words in result.stderr
    assert "Traceback" not in result.output


# ---------------------------------------------------------------- what cannot be packed


@pytest.mark.parametrize(
    ("out", "words"),
    [
        ("no/such/s.fmu", "there is no folder"),
        (".", "is a folder; give the name of a file"),
        ("s.onnx", "the name of an FMU ends in .fmu"),
        ("sensor", "the name of an FMU ends in .fmu"),
    ],
)
def test_places_that_cannot_be_written(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, out: str, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    if out == ".":
        (tmp_path / "d.fmu").mkdir()
        out = "d.fmu"
    result = typed_in(model, "-o", out)
    assert result.exit_code == 2
    assert words in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_full_disk_leaves_what_was_there(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "s.fmu"
    out.write_bytes(b"before")

    def half(path: Path, files: Mapping[str, bytes], compressed: bool = True) -> None:
        if path.parent == tmp_path:
            path.write_bytes(b"half of it")
            raise OSError(28, "No space left on device")
        write_fmu(path, files, compressed)

    monkeypatch.setattr("cosim.pack.packing.write_fmu", half)
    result = typed_in(model, "-o", out)
    assert result.exit_code == 2
    assert f"cannot write '{out}': No space left on device" in result.stderr
    assert out.read_bytes() == b"before"
    assert [path.name for path in tmp_path.iterdir()] == ["s.fmu"]


def test_files_that_are_no_network(tmp_path: Path) -> None:
    text = tmp_path / "a.onnx"
    text.write_text("not a network")
    for path, words in (
        (tmp_path / "gone.onnx", "it cannot be read: No such file or directory"),
        (text, "it is no ONNX model"),
        (fmus.Shipped("vehicle", 3).path, "it is no ONNX model"),
        (MODELS / "fir_w19_ideal.npz", "it is no ONNX model"),
    ):
        result = typed_in(path, "-o", tmp_path / "s.fmu")
        assert result.exit_code == 2
        assert words in result.stderr
        assert str(path) in result.stderr
        assert len(result.stderr.splitlines()) == 1


def test_an_operator_that_is_not_supported_is_named(model: Path, tmp_path: Path) -> None:
    changed = onnx.load(model)
    relu = next(node for node in changed.graph.node if node.op_type == "Relu")
    relu.op_type = "Softplus"
    onnx.save(changed, tmp_path / "soft.onnx")
    result = typed_in(tmp_path / "soft.onnx", "-o", tmp_path / "s.fmu")
    assert result.exit_code == 2
    assert "Softplus" in result.stderr
    assert "not supported" in result.stderr
    with pytest.raises(SensorError):
        pack(tmp_path / "soft.onnx", tmp_path / "s.fmu")
    assert not (tmp_path / "s.fmu").exists()


def test_channels_that_are_unknown(model: Path, tmp_path: Path) -> None:
    changed = onnx.load(model)
    del changed.metadata_props[:]
    onnx.save(changed, tmp_path / "bare.onnx")
    result = typed_in(tmp_path / "bare.onnx", "-o", tmp_path / "s.fmu")
    assert result.exit_code == 2
    assert "its channels are unknown. docs/sensor-c.md shows how to add it." in result.stderr


def test_the_documentation_tells_how_to_add_them(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    bare = onnx.load(model)
    del bare.metadata_props[:]
    onnx.save(bare, "my_network.onnx")
    page = (ROOT / "docs" / "sensor-c.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    exec(program, {})
    assert typed_in("my_network.onnx", "-o", "s.fmu").exit_code == 0


def test_a_template_that_was_never_built(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosim.pack.template.IDENTIFIER", "sonsor")
    result = typed_in(model, "-o", tmp_path / "s.fmu")
    assert result.exit_code == 3
    assert "build it with 'pip install .'" in result.stderr
