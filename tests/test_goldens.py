"""Goldens of real runs: accepted, compared, moved."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from loop_rig import write_scenario

from cosim.batch import find_scenarios
from cosim.cli import main
from cosim.errors import InputError
from cosim.limits import asked_of
from cosim.regression.golden_file import golden_path, read_golden
from cosim.scenario.load import load

SCENARIOS = Path(__file__).parents[1] / "scenarios"
GOLDENS = (
    "[{signal: Truth.VRel.FL, tolerance: 0.002, time_tolerance_s: 0.01},"
    " {signal: Car.az, tolerance: 0.005, from_s: 0.2, to_s: 0.4},"
    " {signal: VRel.Deviation.FL, tolerance: 1},"
    " {signal: soft.Car.vx, tolerance: 0.01}]"
)
RUNS = "[{kind: passive}, {kind: fixed, command: 0, name: soft}]"


def cosim(folder: Path, *options: str) -> Result:
    arguments = ["test", str(folder), "--output-dir", str(folder / "results"), "--jobs", "1"]
    return CliRunner().invoke(main, [*arguments, *options])


def scenario(folder: Path, **sections: str) -> Path:
    fields = {"goldens": GOLDENS, "controllers": RUNS, **sections}
    return write_scenario(folder, duration="0.5", surface="C", sections=fields)


@pytest.fixture(scope="module")
def accepted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    folder = tmp_path_factory.mktemp("goldens")
    scenario(folder)
    return folder, cosim(folder, "--accept")


def test_accepting_makes_the_files_and_says_what_is_new(accepted: tuple[Path, Result]) -> None:
    folder, result = accepted
    assert result.exit_code == 0, result.stderr
    assert "scenario.yaml: passive: Car.az is new" in result.stderr
    assert "scenario.yaml: soft: Car.vx is new" in result.stderr
    files = sorted((folder / "golden" / "scenario").iterdir())
    assert [file.name for file in files] == ["passive.csv", "soft.csv"]
    lines = files[1].read_text().splitlines()
    assert lines[0] == (
        "time [s],Truth.VRel.FL [m/s],Car.az [m/s2],VRel.Deviation.FL [m/s],Car.vx [m/s]"
    )
    times = [float(line.split(",")[0]) for line in lines[1:]]
    assert times[-1] == 0.5
    accelerations = [line.split(",")[2] for line in lines[1:]]
    used = [time for time, cell in zip(times, accelerations, strict=True) if cell]
    assert (used[0], used[-1]) == (0.2, 0.4)


def test_the_same_run_again_is_in_its_tubes(accepted: tuple[Path, Result]) -> None:
    folder, _ = accepted
    before = {file: file.read_bytes() for file in folder.glob("golden/*/*")}
    result = cosim(folder)
    assert result.exit_code == 0, result.stderr
    rows = [line.split() for line in result.stderr.splitlines() if "(" in line and "of" in line]
    assert [(row[1], row[2], " ".join(row[3:6])) for row in rows] == [
        ("(passive)", "passed", "4 of 4"), ("(soft)", "passed", "5 of 5"),
    ]  # fmt: skip
    again = cosim(folder, "--accept")
    assert again.exit_code == 0
    assert "note" not in again.stderr
    assert {file: file.read_bytes() for file in before} == before


def test_another_car_leaves_them_and_is_accepted(
    accepted: tuple[Path, Result], tmp_path: Path
) -> None:
    folder, _ = accepted
    scenario(tmp_path, vehicle="{parameters: {Body.Mass: 3500}}")
    (folder / "golden").rename(tmp_path / "golden")
    try:
        result = cosim(tmp_path)
        assert result.exit_code == 1
        assert "FAILED: soft: distance of Car.az from its golden is " in result.stderr
        assert ", required at most 0.005 m/s2" in result.stderr
        assert "FAILED: passive: golden end" not in result.stderr
        again = cosim(tmp_path, "--accept")
        assert again.exit_code == 0, again.stderr
        assert "scenario.yaml: soft: Car.az has moved by " in again.stderr
        assert " % of its tolerance" in again.stderr
        assert cosim(tmp_path).exit_code == 0
        one = {"controllers": "[{kind: passive}]", "goldens": "[{signal: Car.az, tolerance: 1}]"}
        scenario(tmp_path, **one)
        fewer = cosim(tmp_path, "--accept")
        assert "soft: its goldens are taken away" in fewer.stderr
        assert [file.name for file in tmp_path.glob("golden/*/*")] == ["passive.csv"]
        golden = read_golden(tmp_path / "golden" / "scenario" / "passive.csv", 0.01)
        assert golden is not None
        assert (list(golden.courses), golden.last) == (["Car.az"], 50)
    finally:
        (tmp_path / "golden").rename(folder / "golden")


def test_an_end_at_another_time_and_missing_files(tmp_path: Path) -> None:
    goldens = "[{signal: Car.vx, tolerance: 1, time_tolerance_s: 0.02}]"
    write_scenario(tmp_path, duration="0.3", sections={"goldens": goldens})
    missing = cosim(tmp_path)
    assert missing.exit_code == 1
    assert (
        "file of goldens is not available (there is none yet; cosim test --accept" in missing.stderr
    )
    assert cosim(tmp_path, "--accept").exit_code == 0
    for duration, code in (("0.32", 0), ("0.33", 1)):
        write_scenario(tmp_path, duration=duration, sections={"goldens": goldens})
        result = cosim(tmp_path)
        assert result.exit_code == code, result.stderr
    assert "golden end of the run is 0.33 s, required at least 0.28 s and at most" in result.stderr
    more = goldens.replace("]", ", {signal: Car.ay, tolerance: 1}]")
    write_scenario(tmp_path, duration="0.3", sections={"goldens": more})
    assert "Car.ay from its golden is not available (it is not in the" in cosim(tmp_path).stderr


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "no goldens"), ("a,b\n1,2\n", "no goldens"), ("time [s],Car.vx [m/s]\n", "no goldens"),
        ("time [s],Car.vx [m/s]\n0,x\n", "damaged"), ("time [s],Car.vx [m/s]\n0\n", "damaged"),
        ("time [s],Car.vx [m/s]\n1,2\n0,2\n", "damaged"),
    ],
)  # fmt: skip
def test_a_damaged_file_is_named(tmp_path: Path, content: str, words: str) -> None:
    path = tmp_path / "passive.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=f"passive.csv: {words}.*--accept"):
        read_golden(path, 0.01)
    assert read_golden(tmp_path / "gone.csv", 0.01) is None


@pytest.mark.parametrize(
    ("goldens", "words"),
    [
        ("{signal: Car.azz, tolerance: 1}", "'Car.azz' is not a recorded signal; did you mean"),
        ("{signal: Car.az}", "goldens.0 has no tolerance, which it needs"),
        ("{signal: Car.az, tolerance: 0}", "goldens.0.tolerance must be greater than 0, not 0"),
        ("{signal: Car.az, tolerance: 1, time_tolerance_s: -1}", "must be at least 0 s, not -1 s"),
        ("{signal: Car.az, tolerance: 1}, {signal: passive.Car.az, tolerance: 1}",
         "run passive has a golden of 'Car.az' already"),
        ("{signal: Car.az, tolerance: 1, max: 3}", "'max' is not a field of goldens.0"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_goldens_is_said(tmp_path: Path, goldens: str, words: str) -> None:
    path = write_scenario(tmp_path, sections={"goldens": f"[{goldens}]"})
    with pytest.raises(InputError) as caught:
        load(path)
    assert words in str(caught.value)


def test_the_shipped_goldens_are_there_and_small() -> None:
    files, _ = find_scenarios([SCENARIOS])
    shipped = [one for one in (load(file) for file in files) if one.goldens]
    assert len(shipped) >= 10
    paths = []
    for scenario in shipped:
        for golden in scenario.goldens:
            runs = asked_of(golden.signal, [one.label for one in scenario.controllers])
            for run, name in runs.items():
                path = golden_path(Path(str(scenario.file)), run)
                file = read_golden(path, 0.01)
                assert file is not None, path
                assert len(file.courses[name].rows) > 1, (path, name)
                paths.append(path)
    assert set(paths) == set(SCENARIOS.glob("*/golden/*/*.csv"))
    sizes = [path.stat().st_size for path in set(paths)]
    assert max(sizes) < 100_000
    assert sum(sizes) < 1_000_000
