"""FMUs with binaries for several platforms (fmu/cross.py); compiling for them is `make cross`."""

import sys
import zipfile
from pathlib import Path

import pytest
from fmu_face import FIXTURE, ROOT, build

sys.path.insert(0, str(ROOT / "fmu"))
import cross


def names(fmu: Path) -> set[str]:
    with zipfile.ZipFile(fmu) as archive:
        return set(archive.namelist())


def test_binaries_of_all_platforms_come_together(fmus: dict[int, Path], tmp_path: Path) -> None:
    """The same compiler stands in for the others: only the places count here."""
    windows = build.build(FIXTURE, tmp_path / "windows", target="x86_64-windows")
    arm = build.build(FIXTURE, tmp_path / "arm", target="aarch64-linux")
    whole = cross.merge(fmus[3], [windows[1], arm[1]], tmp_path / "out")
    assert names(whole) - names(fmus[3]) == {
        "binaries/x86_64-windows/lag.dll",
        "binaries/aarch64-linux/lag.so",
    }
    assert names(cross.merge(fmus[2], [windows[0]], tmp_path / "out")) - names(fmus[2]) == {
        "binaries/win64/lag.dll"
    }


def test_the_own_binary_stays(fmus: dict[int, Path], tmp_path: Path) -> None:
    whole = cross.merge(fmus[3], [fmus[3]], tmp_path)
    assert whole.read_bytes() == fmus[3].read_bytes()


def test_the_smoke_test_runs_with_start_values() -> None:
    said = cross.smoke(FIXTURE, None, [], ["--lives=5"])
    assert said.startswith("FMI 2: ")
    assert len({line.partition(";")[2] for line in said.splitlines()}) == 1  # FMI 2 and 3 agree


def test_without_zig_one_sentence_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(cross.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setenv("COSIM_CACHE_DIR", str(tmp_path))
    assert cross.main(["--model", str(FIXTURE), "--out", str(tmp_path)]) == 2
    assert "pip install 'suspension-cosim[cross]'" in capsys.readouterr().err
