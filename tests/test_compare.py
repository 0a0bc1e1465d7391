import json
import math

import numpy as np
import pytest
from stand_in_assembly import GROUPS, WINDOW, StandIn

from cosim.compare import compare, paper_figures
from cosim.limits import check_metric, counted, evaluate
from cosim.metrics import (
    COMFORT_FIGURES,
    ERROR_FIGURES,
    ESTIMATORS,
    MANOEUVRE_FIGURES,
    figure,
    metric_names,
    unit_of,
)
from cosim.recorder import Recorder
from cosim.results import finite
from cosim.scenario.limit import Limit
from cosim.tables import (
    MANOEUVRE_NAMES,
    comparison_table,
    estimate_table,
    manoeuvre_table,
    plain,
)


@pytest.fixture(scope="module")
def figures():
    assembly = StandIn(rows=2000, gain=0.9)
    assembly.run(None)
    return compare(assembly.recorder, assembly.initial_command)


def test_an_estimate_nine_tenths_of_the_truth_is_90_percent_accurate(figures):
    assert figures["sensor"]["overall"]["accuracy_percent"] == pytest.approx(90)
    assert figures["sensor"]["RL"]["nrmse"] == pytest.approx(0.1)
    assert figures["sensor"]["FL"]["rmse_m_s"] == pytest.approx(0.01 / math.sqrt(2), rel=1e-2)
    assert figures["sensor"]["FL"]["max_abs_error_m_s"] == pytest.approx(0.01, rel=1e-2)
    assert figures["truth"]["overall"]["rms_m_s"] == pytest.approx(0.1 / math.sqrt(2), rel=1e-2)


def test_zero_is_0_percent_accurate_on_the_same_samples(figures):
    assert figures["zero"]["overall"]["accuracy_percent"] == pytest.approx(0)
    assert figures["zero"]["FR"]["rmse_m_s"] == figures["truth"]["FR"]["rms_m_s"]


def test_samples_before_the_first_valid_one_do_not_count(figures):
    assert figures["valid_samples"] == 2000 - (WINDOW - 1)


def test_without_a_valid_sample_there_are_no_figures():
    recorder = Recorder(GROUPS, rows=1)
    recorder.append(0, np.zeros(14), np.full(4, np.nan), 0, np.zeros(4), np.zeros(4))
    assert compare(recorder, np.zeros(4)) == {"valid_samples": 0}
    assert compare(Recorder(GROUPS, rows=1), np.zeros(4)) == {"valid_samples": 0}
    assert "Truth" in plain(estimate_table({"valid_samples": 0}))


@pytest.mark.parametrize(
    ("kind", "name"), [("estimator", "fir_w64"), ("network", "my.onnx"), ("fmu", "my.fmu")]
)
def test_the_table_names_the_sensor(figures, kind, name):
    note = f"Sensor: {name}, channels measured in condition production."
    settings = {kind: name, "condition": "production"}
    assert plain(estimate_table(figures, None, settings)).endswith(note)


def test_every_promised_metric_is_measured(figures):
    run = {**figures, "comfort": dict.fromkeys(COMFORT_FIGURES, 1.0)}
    for name in metric_names():
        if name.split(".")[0] in run:  # the linear filter is in none where none is shipped
            assert figure(run, name) is not None, name


def test_every_error_figure_has_a_name(figures):
    assert set(ERROR_FIGURES) == set(figures["sensor"]["FL"]) - {"accuracy_meaningful"}


@pytest.mark.parametrize(
    ("metric", "unit"),
    [
        ("sensor.FL.rmse_m_s", "m/s"),
        ("comfort.weighted_acceleration_m_s2", "m/s²"),
        ("sensor.overall.accuracy_percent", "%"),
        ("lap_time_s", "s"),
        ("comfort.deflection_rms_m", "m"),
        ("comfort.tyre_load_rms_n", "N"),
        ("sensor.FL.nrmse", ""),
    ],
)
def test_units_are_read_off_the_name(metric, unit):
    assert unit_of(metric) == unit


RUNS = {"passive": {"a": {"x_m_s": 1.0}, "lap_time_s": None}, "soft": {"a": {"x_m_s": 2.0}}}


@pytest.mark.parametrize(
    ("limit", "passed"),
    [
        ({"metric": "a.x_m_s", "min": 1}, [True, True]),
        ({"metric": "a.x_m_s", "max": 1}, [True, False]),
        ({"metric": "soft.a.x_m_s", "min": 2, "max": 2}, [True]),
        ({"metric": "lap_time_s", "max": 10}, [False, False]),
    ],
)
def test_limits(limit, passed):
    assert [verdict.passed for verdict in evaluate([Limit(**limit)], RUNS)] == passed


def test_a_limit_counts_on_its_own_surface_only():
    limits = [Limit(metric="x", max=1), *(Limit(metric="x", max=1, surface=s) for s in "AB")]
    found = {s: counted(limits, s, None)[0] for s in ("smooth", "A", None)}
    assert {s: len(kept) for s, kept in found.items()} == {"smooth": 1, "A": 2, None: 1}
    verdict = evaluate(found["A"], {"passive": {"x": 2.0}})[1]
    assert (verdict.passed, verdict.required) == (False, "at most 1 (surface A)")


def test_nan_fails_a_limit():
    verdict = evaluate([Limit(metric="x_m", max=1)], {"passive": {"x_m": math.nan}})[0]
    assert not verdict.passed


def test_a_verdict_says_it_all():
    verdict = evaluate([Limit(metric="a.x_m_s", max=1)], {"soft": RUNS["soft"]})[0]
    assert str(verdict) == "FAILED: soft: a.x_m_s is 2 m/s, required at most 1 m/s"


def test_a_wrong_metric_gets_a_suggestion():
    assert check_metric("sensor.overall.rmse_m_s", []) is None
    assert check_metric("soft.sensor.overall.rmse_m_s", ["soft"]) is None
    assert "'sensor.FL.rmse_m_s'" in (check_metric("sensor.FL.rmse", []) or "")


def test_the_papers_row_stands_beside(figures):
    paper = paper_figures("Hockenheimring track, Normal driver")
    assert paper is not None
    assert paper["overall"] == {"rmse_m_s": 0.0081, "accuracy_percent": 95.8}
    table = estimate_table(figures, paper)
    assert ("Paper's network", "0.0086", "0.0091", "0.0070", "0.0078", "0.0081", "95.8") in [
        row[:7] for row in table.rows
    ]
    assert paper_figures(None) is None


def test_controllers_are_compared_with_the_first(figures):
    runs = {
        "passive": {**figures, "comfort": dict.fromkeys(COMFORT_FIGURES, 2.0)},
        "skyhook_truth": {**figures, "comfort": dict.fromkeys(COMFORT_FIGURES, 1.5)},
    }
    rows = comparison_table(runs).rows
    assert rows[0][:4] == ("passive", "2", "2", "2")
    assert rows[1][:2] == ("skyhook_truth", "1.5 (-25.0 %)")


def test_every_figure_of_a_manoeuvre_has_words_and_a_unit():
    names = {name for figures in MANOEUVRE_FIGURES.values() for name in figures}
    assert set(MANOEUVRE_NAMES) == names
    assert all(unit_of(name) for name in names)
    assert unit_of("yaw_rate_deg_s") == "°/s"
    assert unit_of("yaw_gain_per_s") == "1/s"
    assert unit_of("speed_mean_kmh") == "km/h"


def test_the_manoeuvre_is_a_column_per_run():
    driven = {"manoeuvre": {"clearance_m": 0.05, "side_slip_deg": -3.6539}}
    grip = {"grip": {wheel: {"peak_percent": 80.4} for wheel in ("FL", "FR", "RL", "RR")}}
    table = manoeuvre_table({"soft": driven | grip, "hard": {"manoeuvre": {"clearance_m": -0.1}}})
    assert table is not None
    assert table.columns == ("figure", "soft", "hard")
    assert table.rows == (
        ("Smallest clearance to the cones", "0.05 m", "-0.1 m"),
        ("Side slip angle", "-3.654 °", "-"),
        ("Peak share of grip, FL FR RL RR", "80 80 80 80 %", "-"),
    )
    assert manoeuvre_table({"soft": {"manoeuvre": {}}}) is None


def test_json_never_holds_nan():
    assert json.dumps(finite({"a": [math.nan, math.inf, 1.0]})) == '{"a": [null, null, 1.0]}'


def test_estimators_are_known():
    assert ESTIMATORS[0] == "sensor"
