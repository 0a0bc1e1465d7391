"""The pages of docs/: their numbers are those of the evaluation, and every run that they ask for is
in the evaluation's recipe.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.dataset.plan import plan
from cosim.dataset.recipe import load_recipe
from sensor.channels import CHANNELS, COMMANDS, ROAD, STAGE
from sensor.dataset import Run
from sensor.evaluation import WARM_UP, Estimate, figures
from sensor.paper import paper_rows, search_rows

ROOT = Path(__file__).parents[1]
MEASURE = ROOT / "docs" / "measure"
RECIPE = ROOT / "scenarios" / "datasets" / "evaluation.yaml"
SURFACES = ("smooth", "class_a", "class_b")
ERRORS = {"zero": 1.0, "kalman": 0.2, "carried": 0.1}  # of the truth
TRUTH_RMS = 0.05


@pytest.fixture(scope="module", autouse=True)
def _measure() -> Iterator[None]:
    """Let the pages' scripts import each other, as they do when one of them is run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(MEASURE))
        yield


def run_figures() -> dict[str, Any]:
    """Figures of estimators that miss a known share of the truth."""
    samples = WARM_UP + 200
    phase = np.arange(samples)[:, np.newaxis] * (2.0 * np.pi / 20.0) + np.arange(4)
    truth = TRUTH_RMS * np.sqrt(2.0) * np.sin(phase)
    parts = [np.zeros((samples, len(part))) for part in (CHANNELS, STAGE, COMMANDS)]
    run = Run("sine", *parts, truth, np.zeros((samples, len(ROAD))))  # type: ignore[arg-type]
    speed = np.zeros(samples)
    deviation = np.full(truth.shape, np.nan)
    return {
        estimator: figures(run, Estimate((1.0 - share) * truth, deviation), speed)
        for estimator, share in ERRORS.items()
    }


@pytest.fixture(scope="module")
def evaluated() -> Any:
    from cases import CASES, ROBUST
    from evaluated import Evaluated, scenarios_of_the_paper

    names = {
        f"{stem}_{surface}_passive"
        for stem in scenarios_of_the_paper().values()
        for surface in SURFACES
    }
    cases = [*CASES, *(case for case, _ in ROBUST)]
    names |= {case.pattern.replace("*", "1") for case in cases if "_passive_*" in case.pattern}
    names |= {case.pattern.replace("*", "1") for case in cases if case.pattern.endswith("_*")}
    both = dict.fromkeys(("ideal", "production"), run_figures())
    content = {
        "provenance": {"commit": "0123456789abcdef"},
        "estimators": list(ERRORS),
        "conditions": ["ideal", "production"],
        "runs": [{"name": name, "samples": 200, "figures": both} for name in sorted(names)],
    }
    return Evaluated(json.loads(json.dumps(content)))


def test_goals_are_held_against_accuracy_and_gap_whichever_asks_for_less(
    evaluated: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import goals
    from goals import Goals, best_of

    bounds = [
        {"case": case, "accuracy": {c: {"kalman": 80.0} for c in ("ideal", "production")}}
        for case in ("A at 50 km/h", "B at 50 km/h", "C at 50 km/h")
    ]
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "bounds.json").write_text(json.dumps(bounds))
    monkeypatch.setattr(goals, "ROOT", tmp_path)
    assert best_of(evaluated) == "carried"
    lines = Goals(evaluated, "carried").accuracies().splitlines()[2:]
    cells = {tuple(line.split(" | ")[:2]): line for line in lines}
    # 90 % reached; 93 - 3 would be too much, 80 - 3 not
    mixed = cells["| class A mix", "ideal"]
    assert "| 90 | 83 | 90.0 | 80.0 | -10.0 | 3 | reached |" in mixed
    bounded = [line for line in lines if "class" in line and "sine" not in line]
    assert len(bounded) == 8
    assert all("not reached" not in line for line in bounded)
    # without a bound the goal itself counts
    assert "| 95 | 90 to 93 | 90.0 | - | - | 3 | **not reached** |" in "\n".join(lines)
    lines = Goals(evaluated, "zero").accuracies().splitlines()[2:]
    assert all("**not reached**" in line for line in lines)


def test_goals_on_rows_flat_turns_and_other_cars(evaluated: Any) -> None:
    from goals import Goals

    goals = Goals(evaluated, "carried")
    rows = goals.rows_of_the_paper()
    better = sum(row.accuracy <= 90.0 for row in paper_rows())
    below = sum(row.rmse_overall >= 0.1 * TRUTH_RMS * 0.99 for row in paper_rows())
    assert f"presumed target | 29 | {better} | **not reached** |" in rows
    assert "| 95 | 90.0 | **not reached** |" in rows
    assert f"suspension velocity | 29 | {below} | **not reached** |" in rows
    assert "| ideal | at most 1 | 5.00 | **not reached** |" in goals.flat_turns()
    assert "| production | at most 5 | 5.00 |" in goals.flat_turns()
    lines = goals.robustness().splitlines()[2:]
    assert len(lines) == 20
    assert all(line.endswith("| 90.0 | 90.0 | 0.0 | reached |") for line in lines)
    assert goals.deviations() == "carried state predicts no deviation.\n"


def test_tables_show_the_evaluations_numbers(evaluated: Any) -> None:
    from estimators import cases, parts, rows
    from paper_tables import Table4

    assert "| class B mix | 50.0 | 10.0; 80.0 | 5.00; 90.0 |" in cases(evaluated)
    assert rows(evaluated).count("| 50.0 | 10.0; 80.0 | 5.00; 90.0 |") == 29 * 3 * 2
    assert "| carried state | ideal | 90.0 | 90.0 | 90.0 | 90.0 |" in parts(evaluated)
    table_4 = Table4(evaluated, "smooth")
    assert "| v_x sin θ₀ alone | Kalman | carried state |" in table_4.on_presumed_target()
    assert "| **mean of 20 testing rows** |  | 89.2 | 0.0 | 80.0 | 90.0 |" in (
        table_4.on_presumed_target()
    )


def test_every_run_of_the_pages_is_in_the_recipe(evaluated: Any) -> None:
    """The runs that are made up above bear the names that the data set's files have."""
    recipe = load_recipe(RECIPE)
    planned = [run.stem for run in plan(recipe)]
    made_up = {re.sub(r"_\d+$", "", run["name"]) for run in evaluated.runs}
    assert made_up <= {re.sub(r"_\d+$", "", stem) for stem in planned}


def test_missing_runs_are_named(evaluated: Any) -> None:
    from cases import Case

    with pytest.raises(ValueError, match="no run of the evaluation is called gravel_"):
        evaluated.case(Case("gravel", "gravel_*"))


def test_pictures_are_the_same_bytes_each_time(evaluated: Any, tmp_path: Path) -> None:
    from estimators import draw_cases
    from paper_plots import reference_and_speed

    for name in ("a", "b"):
        draw_cases(tmp_path / name / "cases.svg", evaluated)
        reference_and_speed(tmp_path / name / "reading.svg")
    for picture in ("cases.svg", "reading.svg"):
        first, second = ((tmp_path / name / picture).read_bytes() for name in ("a", "b"))
        assert first == second
        assert b"<svg" in first


def test_results_of_a_search_stand_beside_the_papers(tmp_path: Path) -> None:
    from search_results import SearchResults

    grid = [1, 256, 512]
    surface = {"units": grid, "hidden": grid, "mean": np.full((3, 3), 0.01).tolist()}
    surface["mean"][1][1] = 0.009
    windows = [
        {
            "window": row.window, "units": 10 + row.window, "hidden": 20, "rmse": rmse,
            "relative_error_percent": 100 * rmse / 0.02, "relative_duration_percent": 150.0,
            "trials": [{"number": n, "units": 9, "hidden": 8, "rmse": rmse, "seconds": 1800.0}
                       for n in range(2)],
            "surface": surface,
        }
        for row, rmse in zip(search_rows()[:3], (0.02, 0.0102, 0.01), strict=True)
    ]  # fmt: skip
    shapes = [
        {"window": row.window, "duration_s": 1e-4, "relative_duration_percent": 100.0}
        for row in search_rows()
    ]
    content = {"windows": windows, "paper_shapes": shapes, "recipe": {"name": "search"}}
    (tmp_path / "search.json").write_text(json.dumps(content))
    found = SearchResults(tmp_path / "search.json")
    assert (found.trials, found.hours, found.best["window"]) == (6, 3.0, 11)
    lines = found.table().splitlines()
    assert len(lines) == 2 + 9
    assert lines[2] == (
        "| 3 | 2 | 360 / 13 | 403 / 20 | 17.1 / 20.0 | 100.0 / 100.0 | 100.0 / 150.0 | 100 |"
    )
    assert "| 51 | - | 137 / - |" in lines[-1]
    assert "50 % less error" in found.verdict()
    assert "the windows 7, 11." in found.verdict()
    found.figure_6(tmp_path / "figure_6.svg")
    assert found.figure_5(tmp_path / "figure_5.svg") == 3  # the paper's 21 is not there yet
    assert (tmp_path / "figure_5.svg").stat().st_size > 10_000


def test_a_page_with_a_number_missing_is_not_written(tmp_path: Path) -> None:
    from markdown_tables import fill

    page = tmp_path / "paper-scenarios.md"
    with pytest.raises(KeyError, match="laps"):
        fill(page, {"driven_s": 1, "manoeuvres": ""})
    assert not page.exists()
    fill(page, {"driven_s": 1, "manoeuvres": "m", "laps": "l"})
    assert "they are 1 s of driving" in page.read_text(encoding="utf-8")
    assert "markdown_tables" in sys.modules
