"""What a search found, for people as a table and for programs as JSON: Table 3 and Figure 5."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from optuna.study import Study
from optuna.trial import FrozenTrial

from sensor.paper import search_rows
from sensor.provenance import versions
from sensor.recipe import SearchRecipe
from sensor.search.durations import Shape, durations
from sensor.search.study import finished
from sensor.search.surface import fit_surface

_GRID = 17


def results(recipe: SearchRecipe, studies: Mapping[int, Study], samples: int) -> dict[str, Any]:
    """Return trials, best shape, durations and surface of each window that has finished trials.

    The times are measured here, over `samples` samples of each network, ours and the paper's in
    turns. RMSE in m/s, times in s; relative figures in percent of the shortest window's.
    """
    windows = [
        _window(recipe, window, trials)
        for window, study in sorted(studies.items())
        if (trials := finished(study))
    ]
    printed = {row.window: row for row in search_rows()}
    ours = [Shape(one["window"], one["units"], one["hidden"]) for one in windows]
    theirs = [Shape(row.window, row.units, row.hidden) for row in printed.values()]
    seconds = durations([*ours, *theirs], samples)
    return {
        "recipe": recipe.model_dump(mode="json"),
        "versions": versions(),
        "duration_samples": samples,
        "windows": _with_relative(windows, seconds[: len(ours)]),
        "paper_shapes": _with_relative([vars(shape) for shape in theirs], seconds[len(ours) :]),
    }


def _window(recipe: SearchRecipe, window: int, trials: Sequence[FrozenTrial]) -> dict[str, Any]:
    shapes = np.array([[t.params["units"], t.params["hidden"]] for t in trials], dtype=np.float64)
    rmse = np.array([t.value for t in trials], dtype=np.float64)
    best = int(np.argmin(rmse))
    most = max(recipe.units.most, recipe.hidden.most)
    grid = np.unique(np.linspace(1, most, _GRID).round())
    return {
        "window": window,
        "units": int(shapes[best, 0]),
        "hidden": int(shapes[best, 1]),
        "rmse": float(rmse[best]),
        "trials": [_trial(trial) for trial in trials],
        "surface": fit_surface(shapes, rmse, grid).as_dict() if len(trials) > 1 else None,
    }


def _trial(trial: FrozenTrial) -> dict[str, Any]:
    return {"number": trial.number, **trial.params, "rmse": trial.value, **trial.user_attrs}


def _with_relative(
    rows: Sequence[Mapping[str, Any]], seconds: Sequence[float]
) -> list[dict[str, Any]]:
    """Add each network's time, and time and error relative to the first row's."""
    return [
        dict(row)
        | {"duration_s": duration, "relative_duration_percent": 100.0 * duration / seconds[0]}
        | (
            {"relative_error_percent": 100.0 * row["rmse"] / rows[0]["rmse"]}
            if "rmse" in row
            else {}
        )
        for row, duration in zip(rows, seconds, strict=True)
    ]
