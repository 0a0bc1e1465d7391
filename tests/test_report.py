import base64
import json
import re
import sys

import numpy as np
import pytest
from stand_in_assembly import StandIn, assemble

from cosim.report import ReportError, write_report
from cosim.run import execute
from cosim.scenario.load import load

SCENARIO = """\
name: "<b>Lap</b> & more"
road: {track: hockenheim}
paper_row: Hockenheimring track, Normal driver
limits: [{metric: sensor.overall.accuracy_percent, min: 80}, {metric: lap_time_s, max: 1}]
"""


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    (folder / "a.yaml").write_text(SCENARIO)
    return execute(load(folder / "a.yaml"), folder / "out", None, assemble, "cosim run a.yaml")


@pytest.fixture(scope="module")
def page(outcome):
    return (outcome.output_dir / "report.html").read_text()


def signals(page):
    text = re.search(r'<script type="application/json" id="signals">(.*?)</script>', page, re.S)
    return json.loads(text.group(1))["runs"]


def test_it_asks_for_nothing_from_outside(page):
    assert "default-src 'none'" in page
    links = re.findall(r'(?:src|href)\s*=\s*"([^"]*)"', page)
    assert links == ["data:,"]
    assert "@import" not in page
    assert "url(" not in page


def test_verdict_first_then_table_command_and_versions(page):
    body = page[page.index("<body>") :]
    order = ["Failed: 1 of 2 limits", "95 % of errors", "Paper&#39;s network", "cosim run a.yaml"]
    positions = [body.index(text) for text in [*order, "numpy"]]
    assert positions == sorted(positions)


def test_text_is_escaped(page):
    assert "&lt;b&gt;Lap&lt;/b&gt; &amp; more" in page
    assert "<b>Lap" not in page


def test_signals_lie_in_the_page_as_float32(page, outcome):
    run = signals(page)[0]
    recorder = outcome.runs[0].recorder
    truth = np.frombuffer(base64.b64decode(run["wheels"]["RL"]["truth"]), "<f4")
    np.testing.assert_array_equal(truth, recorder.group("truth")[:, 2].astype("<f4"))
    estimate = np.frombuffer(base64.b64decode(run["wheels"]["RL"]["estimate"]), "<f4")
    assert np.isnan(estimate[:18]).all()
    assert np.isfinite(estimate[18:]).all()


def test_commands_are_shown_only_where_a_controller_moved(page):
    assert signals(page)[0]["command"] is None


def test_a_lap_stays_small(tmp_path, outcome):
    assembly = StandIn(rows=12_000)
    (tmp_path / "a.yaml").write_text(SCENARIO)
    execute(load(tmp_path / "a.yaml"), tmp_path / "out", None, lambda *_: assembly)
    assert (tmp_path / "out" / "report.html").stat().st_size < 1e6


def test_without_uplot_the_run_goes_on(tmp_path, monkeypatch, outcome):
    monkeypatch.setitem(sys.modules, "uplot", None)
    with pytest.raises(ReportError):
        write_report(outcome, {}, tmp_path / "report.html")
    (tmp_path / "a.yaml").write_text(SCENARIO)
    result = execute(load(tmp_path / "a.yaml"), tmp_path / "out", None, assemble)
    assert result.notes == (
        "no report.html was written: it needs uplot-python; pip install 'suspension-cosim[report]'",
    )
    assert (tmp_path / "out" / "metrics.json").exists()


def test_a_manoeuvre_shows_its_figures_below_the_limits(tmp_path):
    (tmp_path / "a.yaml").write_text(
        "name: circle\nroad: {track: circle, radius_m: 60, angle_deg: 60}\n"
        "manoeuvre: {kind: constant_radius}\ndriver: {speed_kmh: 40}\n"
        "limits: [{metric: manoeuvre.path_deviation_m, max: 0.2}]\n"
    )
    done = execute(load(tmp_path / "a.yaml"), tmp_path / "out")
    body = (done.output_dir / "report.html").read_text()
    order = [
        "Passed: 1 of 1 limits",
        "manoeuvre.path_deviation_m",
        "Steady lateral acceleration",
        "Peak share of grip, FL FR RL RR",
        "Time of the manoeuvre",
    ]
    positions = [body.index(text) for text in order]
    assert positions == sorted(positions)
    assert done.metrics["runs"]["passive"]["manoeuvre"]["side_slip_deg"] > 0.0
