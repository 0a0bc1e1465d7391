"""`cosim check` as a user types it: words, JSON, exit codes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from fmu_face import ROOT
from fmu_mutants import MODEL, mutate, put, put_outer

from cosim.check.codes import as_markdown
from cosim.check.finding import Finding, Report, listed
from cosim.check.show import show, verdict
from cosim.cli import main


@pytest.fixture(scope="module")
def lag(fmus: dict[int, Path]) -> Path:
    return fmus[2]


def typed(*words: object) -> Result:
    return CliRunner().invoke(main, ["check", *map(str, words)])


def test_a_sound_fmu(lag: Path) -> None:
    result = typed("--static", lag)
    assert result.exit_code == 0, result.output
    assert result.stdout == f"{lag}: FMI 2.0, no defects, no warnings; not run\n"
    assert result.stderr == ""


def test_defects_are_exit_code_1_and_warnings_are_not(lag: Path, tmp_path: Path) -> None:
    bad = mutate(lag, tmp_path / "bad.fmu", {MODEL: put("In.u", start="20.0")})
    result = typed("--static", bad)
    assert result.exit_code == 1
    first, second = result.stdout.splitlines()
    assert first == f"{bad}: FMI 2.0, 1 defect, no warnings; not run"
    assert second.split()[:2] == ["error", "start-outside-range"]
    bare = mutate(lag, tmp_path / "bare.fmu", {MODEL: put_outer("In.u", description=None)})
    result = typed("--static", bare)
    assert result.exit_code == 0
    assert "no defects, 1 warning" in result.stdout


def test_json_is_for_programs(lag: Path, tmp_path: Path) -> None:
    bad = mutate(lag, tmp_path / "bad.fmu", {MODEL: put("In.u", start="20.0")})
    result = typed("--static", "--json", lag, bad, tmp_path / "gone.fmu")
    assert result.exit_code == 2
    sound, broken, gone = json.loads(result.stdout)
    assert (sound["errors"], sound["findings"], sound["fmi_version"]) == (0, [], "2.0")
    assert broken["findings"][0]["code"] == "start-outside-range"
    assert broken["findings"][0]["severity"] == "error"
    assert "no such file" in gone["error"]


def test_one_unreadable_file_does_not_stop_the_others(lag: Path, tmp_path: Path) -> None:
    result = typed("--static", tmp_path / "gone.fmu", lag)
    assert result.exit_code == 2
    assert "gone.fmu: no such file" in result.stderr
    assert "no defects" in result.stdout


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ([], "Missing argument 'FMU...'"),
        (["lag.fmi3.fnu"], "did you mean 'lag.fmi3.fmu'?"),
        (["."], "is a folder, not an FMU"),
        (["notes.txt"], "not a ZIP archive"),
        (["--dynamic", "lag.fmi3.fmu"], "No such option"),
    ],
)
def test_wrong_usage(
    lag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], text: str
) -> None:
    monkeypatch.chdir(lag.parent)
    Path("notes.txt").write_text("not a zip")
    result = typed(*words)
    assert result.exit_code == 2
    assert text in result.stderr
    assert "Traceback" not in result.output


class Terminal:
    """A stream that says it is a terminal."""

    def __init__(self) -> None:
        self.text = ""

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        self.text += text
        return len(text)

    def flush(self) -> None:
        """Nothing is held back."""


def report_of(count: int) -> Report:
    report = Report(Path("a.fmu"), "3.0")
    report.add(Finding("nominal-zero", f"m.xml:{i}", f"x{i}: nominal is 0") for i in range(count))
    report.not_judged.append("whether it steps")
    return report


def test_a_terminal_gets_a_table_with_the_same_words() -> None:
    terminal = Terminal()
    show(report_of(1), terminal)  # type: ignore[arg-type]
    assert verdict(report_of(1)) in terminal.text
    assert "x0: nominal is 0" in terminal.text
    assert "not judged: whether it steps" in terminal.text


def test_many_findings_of_one_kind_are_cut_short(capsys: pytest.CaptureFixture[str]) -> None:
    import sys

    show(report_of(25), sys.stdout)
    out = capsys.readouterr().out
    assert out.count("nominal is 0") == 10
    assert "and 15 more of nominal-zero; --json shows all" in out


def test_findings_are_said_once_and_errors_first() -> None:
    report = Report(Path("a.fmu"))
    report.add([Finding("description-missing", "a", "b"), Finding("schema", "a", "b")])
    report.add([Finding("schema", "a", "b")])
    assert report.codes == ["schema", "description-missing"]
    assert listed("abcdefg", 3) == "a, b, c and 4 more"


def test_the_documentation_has_every_code() -> None:
    assert as_markdown() in (ROOT / "docs" / "check.md").read_text(encoding="utf-8")
