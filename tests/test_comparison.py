"""`cosim compare`: runs read from their folders, the table, the page, and mistakes."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner

from cosim.cli import main
from cosim.comfort import WK, weighting_gain
from cosim.comparison.plots import plots_of, spectrum
from cosim.comparison.read import read_runs
from cosim.comparison.table import COLUMNS, table_of
from cosim.errors import InputError
from cosim.metrics import metric_names
from cosim.recorder import Format, Recorder, Signal

Array = npt.NDArray[np.float64]

SIGNALS = {
    "Car.Seat.az": "m/s2", "Car.FzFL": "N", "Car.FzFR": "N", "Car.FzRL": "N", "Car.FzRR": "N",
    "Car.DampFL.Frc": "N",
}  # fmt: skip


def figures(acceleration: float, load: float) -> dict[str, Any]:
    comfort = {"weighted_acceleration_m_s2": acceleration, "tyre_load_rms_n": load}
    return {"comfort": comfort, "decisions": {}}


def results(
    folder: Path, runs: dict[str, Any], scenario: str = "a road", file_format: Format = "csv"
) -> Path:
    """A folder as `cosim run` leaves it; every signal is a sine of its column's own frequency."""
    folder.mkdir(parents=True)
    (folder / "metrics.json").write_text(json.dumps({"scenario": scenario, "runs": runs}))
    for label in runs:
        signals = [Signal(name, unit) for name, unit in SIGNALS.items()]
        record = Recorder([("vehicle", signals)], 2000)
        for k in range(2000):
            record.append(k, np.sin(2 * np.pi * np.arange(1, 7) * 0.01 * k))
        record.write(folder if len(runs) == 1 else folder / label, file_format)
    return folder


@pytest.fixture
def both(tmp_path: Path) -> Path:
    return results(tmp_path / "loop", {"passive": figures(0.6, 700), "skyhook": figures(0.45, 665)})


def test_a_folder_stands_for_its_runs_and_a_run_s_own_for_one(both: Path, tmp_path: Path) -> None:
    alone = results(tmp_path / "lap", {"other": figures(0.5, 680)}, "a lap")
    found = read_runs([both / "skyhook", alone])
    assert [(run.name, run.scenario) for run in found] == [
        ("skyhook", "a road"),
        ("other", "a lap"),
    ]
    assert [run.name for run in read_runs([both])] == ["passive", "skyhook"]


def test_runs_of_one_name_are_told_apart_by_their_scenario_s_folder(
    both: Path, tmp_path: Path
) -> None:
    alone = results(tmp_path / "lap", {"passive": figures(0.5, 680)})
    names = [run.name for run in read_runs([both, alone])]
    assert names == ["loop/passive", "skyhook", "lap/passive"]


def test_one_scenario_from_two_folders_is_told_apart_by_what_lies_above(tmp_path: Path) -> None:
    runs = {"passive": figures(0.6, 700), "skyhook": figures(0.45, 665)}
    before = results(tmp_path / "before" / "loop", runs)
    after = results(tmp_path / "after" / "loop", runs)
    alone = results(tmp_path / "alone", {"skyhook": figures(0.5, 680)})
    assert [run.name for run in read_runs([before, after / "skyhook", alone])] == [
        "passive", "before/loop/skyhook", "after/loop/skyhook", f"{tmp_path.name}/alone/skyhook",
    ]  # fmt: skip


def test_a_run_that_alone_has_ended_lies_below_its_scenario_s_folder(both: Path) -> None:
    metrics = json.loads((both / "metrics.json").read_text())
    del metrics["runs"]["skyhook"]
    (both / "metrics.json").write_text(json.dumps(metrics))
    other = results(both.parent / "lap", {"other": figures(0.5, 680)})
    assert [run.folder for run in read_runs([both, other])] == [both / "passive", other]


@pytest.mark.parametrize("file_format", ["csv", "parquet"])
def test_signals_come_back_as_they_were_written(tmp_path: Path, file_format: Format) -> None:
    runs = {"one": figures(0.5, 600), "two": figures(0.4, 600)}
    folder = results(tmp_path / "out", runs, file_format=file_format)
    read = read_runs([folder])[1].signals(["Car.FzFR", "Car.Roll"])
    assert set(read) == {"time", "Car.FzFR"}
    np.testing.assert_array_equal(read["time"], 0.01 * np.arange(2000))
    np.testing.assert_allclose(read["Car.FzFR"], np.sin(2 * np.pi * 3 * read["time"]), atol=1e-9)


def test_the_table_shows_changes_against_the_first_run(both: Path) -> None:
    table = table_of(read_runs([both]))
    assert table.columns == ("run", "a_w [m/s²]", "tyre load rms [N]")
    assert table.rows == (("passive", "0.6", "700"), ("skyhook", "0.45 (-25.0)", "665 (-5.0)"))
    assert "different scenarios" not in table.note


def test_runs_of_different_scenarios_are_compared_with_a_warning(
    both: Path, tmp_path: Path
) -> None:
    other = results(tmp_path / "lap", {"one": figures(0.5, 680)}, "a lap")
    assert "different scenarios" in table_of(read_runs([both, other])).note


@pytest.mark.parametrize(("seconds", "told"), [(40.0, False), (40.3, False), (20.0, True)])
def test_runs_of_different_length_are_told(tmp_path: Path, seconds: float, told: bool) -> None:
    runs = {"one": figures(0.5, 600), "two": figures(0.4, 600)}
    runs["one"]["simulated_s"], runs["two"]["simulated_s"] = 40.0, seconds
    note = table_of(read_runs([results(tmp_path / "out", runs)])).note
    assert ("The runs last from 20 to 40 s; VDV and damper energy grow" in note) == told
    assert ("VDV" in note) == told


def test_every_column_is_a_figure_that_runs_have() -> None:
    assert set(COLUMNS) <= set(metric_names())


# ---------------------------------------------------------------- spectra


def test_the_area_below_a_spectrum_is_the_mean_square() -> None:
    """Of noise within the band; a sine stands at its frequency with its W_k."""
    t = 0.01 * np.arange(12_000)
    sine = 2.0 * np.sin(2 * np.pi * 5.0 * t)[:, None]
    frequency, density = spectrum(sine, 0.01, weighted=False)
    assert frequency[np.argmax(density)] == 5.0
    assert np.trapezoid(density, frequency) == pytest.approx(2.0, rel=0.01)
    weighted = spectrum(sine, 0.01, weighted=True)[1]
    expected = 2.0 * float(weighting_gain(WK, 5.0)) ** 2
    assert np.trapezoid(weighted, frequency) == pytest.approx(expected, rel=0.01)


def test_several_signals_are_averaged() -> None:
    random = np.random.default_rng(1).standard_normal((20_000, 2))
    one, other, mean = (
        spectrum(part, 0.01, weighted=False)[1] for part in (random[:, [0]], random[:, [1]], random)
    )
    np.testing.assert_allclose(mean, (one + other) / 2)


def test_the_page_s_data(both: Path) -> None:
    data = plots_of(read_runs([both]))
    assert data["plane"] == [[0.6, 700], [0.45, 665]]
    seat, loads = data["spectra"]
    assert seat["frequency"][int(np.argmax(seat["lines"][0]))] == 1.0
    assert len(loads["lines"]) == 2
    assert [one["title"] for one in data["signals"]] == [
        "Vertical acceleration at the seat", "Damper force, front left",
    ]  # fmt: skip
    line = data["signals"][0]["lines"][1]
    values = np.frombuffer(base64.b64decode(line["values"]), "<f4")
    assert line["step"] == 0.01
    np.testing.assert_allclose(values, np.sin(2 * np.pi * 0.01 * np.arange(2000)), atol=1e-6)


def test_a_run_without_signals_keeps_its_place(both: Path) -> None:
    (both / "passive" / "signals.csv").unlink()
    data = plots_of(read_runs([both]))
    assert data["spectra"][0]["lines"][0] is None
    assert data["signals"][0]["lines"][0] is None
    assert data["signals"][0]["lines"][1] is not None


# ---------------------------------------------------------------- the command


def compare(*arguments: str | Path) -> Any:
    return CliRunner().invoke(main, ["compare", *map(str, arguments)])


def test_the_command_prints_a_table_and_writes_a_page(both: Path, tmp_path: Path) -> None:
    page = tmp_path / "pages" / "c.html"
    result = compare(both, "--output", page, "--json")
    assert result.exit_code == 0, result.stderr
    assert "0.45 (-25.0)" in result.stderr
    printed = json.loads(result.stdout)
    assert [one["run"] for one in printed] == ["passive", "skyhook"]
    assert printed[1]["figures"]["comfort.tyre_load_rms_n"] == 665
    text = page.read_text()
    assert re.findall(r'(?:src|href)\s*=\s*"([^"]*)"', text) == ["data:,"]
    assert "default-src 'none'" in text
    assert "0.45 (-25.0)" in text


def test_a_name_that_is_code_is_only_a_name(tmp_path: Path) -> None:
    runs = {"one": figures(0.5, 600), "two": figures(0.4, 600)}
    folder = results(tmp_path / "out", runs, "<script>alert(1)</script>")
    assert compare(folder, "--output", tmp_path / "c.html").exit_code == 0
    assert "<script>alert" not in (tmp_path / "c.html").read_text()


def test_all_mistakes_at_once(both: Path, tmp_path: Path) -> None:
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "metrics.json").write_text("{")
    wrong = (tmp_path / "gone", both / "skyhok", tmp_path, tmp_path / "broken", both, both)
    result = compare(*wrong)
    assert result.exit_code == 2
    for words in (
        "gone' is no folder",
        "has no run 'skyhok'; did you mean 'skyhook'?",
        f"'{tmp_path}' holds no metrics.json; give a folder that cosim run has written",
        "metrics.json' cannot be read",
        "passive' is given twice",
    ):
        assert words in result.stderr
    assert "Traceback" not in result.output


@pytest.mark.parametrize(("end", "content"), [("csv", ""), ("csv", "time\nx\n"), ("parquet", "x")])
def test_signals_that_are_no_table_are_said(
    both: Path, tmp_path: Path, end: str, content: str
) -> None:
    (both / "passive" / "signals.csv").unlink()
    (both / "passive" / f"signals.{end}").write_text(content)
    result = compare(both, "--output", tmp_path / "c.html")
    assert result.exit_code == 2
    assert f"signals.{end}' cannot be read: " in result.stderr
    assert isinstance(result.exception, SystemExit)


@pytest.mark.parametrize("runs", [[], {"one": 3}])
def test_metrics_without_figures_by_name_are_said(tmp_path: Path, runs: Any) -> None:
    (tmp_path / "metrics.json").write_text(json.dumps({"scenario": "a road", "runs": runs}))
    with pytest.raises(InputError, match="its runs have no figures by name"):
        read_runs([tmp_path])


def test_one_run_is_no_comparison(both: Path) -> None:
    with pytest.raises(InputError, match="two runs or more"):
        read_runs([both / "passive"])
