"""The paper beside our plant, table by table and figure by figure: `make paper`.

Writes docs/paper.md and its pictures from the evaluation's figures and runs and the results of the
search.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import numpy as np
from evaluated import NAMES, ROOT, SURFACES, Evaluated
from markdown_tables import fill, filled, millimetres, percent, table
from paper_plots import PAPER_BAND, Lap, figure_7, figure_8, reference_and_speed, relative_spectrum
from paper_tables import NETWORK, SPLITS, Table4
from search_results import SearchResults
from windows import Sweep, seen, sweep, window_figure

from sensor.dataset import read_run, read_runs
from sensor.estimators import make
from sensor.evaluation import estimate, measured_channels
from sensor.metrics import rms
from sensor.paper import PRINTED_MEAN_ACCURACY, paper_rows
from sensor.paper.reading import LIMIT_M_S2, Reading, mean_accuracy, projection, readings

Values = dict[str, object]

PAGE = ROOT / "docs" / "paper.md"
PICTURES = ROOT / "docs" / "paper"
LAP = "hockenheim_normal_smooth_passive"
SHOWN = (NETWORK, "fir_w19", "kalman", "carried")
STEADY = {50.0: "straight_b_050_passive_*", 80.0: "straight_b_080_passive_*"}
TRAINING, UNSEEN = ("heilbronn_*", "rural_*"), "hockenheim_*"
SEEN_WINDOWS = (3, 7, 11, 17, 19, 21, 25, 31, 51)


@click.command(help=__doc__)
@click.option("--evaluation", required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--data", required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--search", required=True, type=click.Path(path_type=Path))
def main(evaluation: Path, data: Path, search: Path) -> None:
    """Write the page."""
    evaluated = Evaluated.read(evaluation)
    tables = {surface: Table4(evaluated, surface) for surface in SURFACES}
    values: Values = {"commit": evaluated.commit, "search": search_text(search)}
    values |= reading_values(tables["smooth"], tables["class_a"])
    values["projected_smooth"] = tables["smooth"].on_presumed_target()
    for surface, one in tables.items():
        values[f"table_4_{surface}"] = one.as_in_the_paper()
        values[f"beside_{surface}"] = one.on_the_truth()
    values |= lap_values(evaluated, data)
    values |= window_values(data)
    values |= difference_values(tables["smooth"])
    fill(PAGE, values)


def reading_values(smooth: Table4, class_a: Table4) -> Values:
    """What the paper's tables say beyond their words, and our figures for it."""
    reference_and_speed(PICTURES / "reading.svg")
    fit = projection()
    kinds = {kind: [one for one in readings() if one.kind == kind] for kind in ("limit", "bumps")}
    lost = (
        f"{3.6 * (one.speed or 0):.0f} → {3.6 * fit.implied_speed(one):.0f}"
        for one in kinds["limit"]
    )
    laps = [one for one in readings() if one.kind == "lap" and "Normal" in one.row.scenario]
    turns = [
        one.row
        for one in readings()
        if one.kind == "flat" and one.row.scenario.startswith("Constant")
    ]
    ours = (smooth.figures(one.row)["overall"]["truth_rms"] for one in kinds["bumps"])
    moved = [class_a.figures(row)["overall"]["truth_rms"] for row in turns]
    left = {name: min(_rmse(class_a, turns, name)) for name in class_a.beside}
    best = min(left, key=lambda name: left[name])
    return {
        "flat_rows": len(fit.rows),
        "slope": f"{fit.slope:.5f}",
        "slope_deviation": f"{fit.deviation:.5f}",
        "theta0": f"{np.rad2deg(fit.angle):.2f}",
        "limit_rows": len(kinds["limit"]),
        "limit_m_s2": f"{LIMIT_M_S2:.0f}",
        "lost_speeds": ", ".join(lost),
        "bump_motion": ", ".join(f"{1e3 * _motion(one, fit.slope):.0f}" for one in kinds["bumps"]),
        "our_bump_motion": ", ".join(f"{1e3 * value:.0f}" for value in ours),
        "lap_speeds": ", ".join(f"{3.6 * fit.implied_speed(one):.0f}" for one in laps),
        "class_a_turns": f"{1e3 * min(moved):.0f} to {1e3 * max(moved):.0f}",
        "class_a_left": millimetres(left[best]),
        "class_a_best": NAMES[best],
        "printed_mean": PRINTED_MEAN_ACCURACY,
        "mean_all": f"{mean_accuracy():.2f}",
        "mean_testing": f"{mean_accuracy('testing'):.1f}",
        "mean_unseen": f"{mean_accuracy('validation', 'testing'):.1f}",
    }


def _motion(one: Reading, slope: float) -> float:
    """Rms [m/s] of a reference that is left when the projection is taken off."""
    return float(np.sqrt(max(one.truth_rms**2 - (slope * (one.speed or 0.0)) ** 2, 0.0)))


def _rmse(table_4: Table4, rows: list[Any], estimator: str) -> list[float]:
    return [float(table_4.figures(row, estimator)["overall"]["rmse"]) for row in rows]


def search_text(file: Path) -> str:
    """Draw Figures 5 and 6; return the section on the search."""
    if not file.is_file():
        return f"There is no `{file.name}`: the search has not been run."
    results = SearchResults(file)
    results.figure_6(PICTURES / "figure_6.svg")
    best = results.best
    return filled(
        "search.md",
        {
            "trials": results.trials,
            "windows": len(results.rows),
            "hours": f"{results.hours:.1f}",
            "recipe": results.recipe["name"],
            "table": results.table(),
            "best_window": best["window"],
            "best_units": best["units"],
            "best_hidden": best["hidden"],
            "verdict": results.verdict(),
            "surface_window": results.figure_5(PICTURES / "figure_5.svg"),
        },
    )


def lap_values(evaluated: Evaluated, data: Path) -> Values:
    """Draw Figures 7 and 8 from the lap that the paper shows; return their numbers."""
    run = read_run(data / f"{LAP}.parquet")
    names = {name: NAMES[name] for name in SHOWN if name in evaluated.estimators}
    measured = measured_channels(run, "ideal")
    estimates = {name: estimate(make(name, "ideal"), measured, run).velocities for name in names}
    lap = Lap(run.truth.astype(np.float64), estimates)
    figure_7(PICTURES / "figure_7.svg", lap, names)
    low, high = figure_8(PICTURES / "figure_8.svg", lap, NETWORK)
    error = lap.error(NETWORK)
    frequency, relative = relative_spectrum(lap.truth[:, 0], lap.estimates[NETWORK][:, 0])
    largest, deviation = float(np.abs(error).max()), rms(error)
    power = np.square(np.abs(np.fft.rfft(lap.truth[:, 0])))
    hertz = np.fft.rfftfreq(len(lap.truth), 0.01)
    return {
        "largest": f"{1e3 * largest:.0f}",
        "lap_rmse": f"{1e3 * deviation:.1f}",
        "relative_low": f"{relative[(frequency > 0) & (frequency <= 3)].mean():.0f}",
        "relative_high": f"{relative[(frequency >= 5) & (frequency <= 15)].mean():.0f}",
        "high_share": f"{100 * power[hertz > 5].sum() / power.sum():.2f}",
        "band_low": f"{1e3 * low:.1f}",
        "band_high": f"{1e3 * high:.1f}",
        "inside": f"{_share((error > PAPER_BAND[0]) & (error < PAPER_BAND[1])):.0f}",
        "within_one": f"{_share(np.abs(error) < deviation):.0f}",
        "sigmas": f"{largest / deviation:.1f}",
        "lap_s": f"{lap.time[-1]:.0f}",
    }


def _share(holds: np.ndarray[Any, np.dtype[np.bool_]]) -> float:
    return 100.0 * float(np.mean(holds))


def window_values(data: Path) -> Values:
    """Measure what a longer window sees and gives, and draw it."""
    sweeps: dict[str, Sweep] = {}
    for surface in ("class_a", "class_b"):
        training = read_runs(data, [f"{track}_{surface}_passive" for track in TRAINING])
        unseen = read_runs(data, [f"{UNSEEN}_{surface}_passive"])
        sweeps[SURFACES[surface]] = sweep(training, unseen)
    steady = {speed: steady_sweep(data, pattern) for speed, pattern in STEADY.items()}
    window_figure(PICTURES / "windows.svg", sweeps, steady)
    gains = [
        values[64] - values[19] for one in sweeps.values() for values in (one.raw, one.residual)
    ]
    named = {f"class B at {speed:.0f} km/h": one for speed, one in steady.items()}
    at_50 = steady[50.0].raw
    return {
        "seen": seen_table(data),
        "sweeps": sweep_table(sweeps | named),
        "window_gain": f"{max(gains):.1f}",
        "step_at_50": f"{at_50[21] - at_50[19]:.1f}",
        "rest_at_50": f"{at_50[64] - at_50[21]:.1f}",
    }


def steady_sweep(data: Path, pattern: str) -> Sweep:
    """Fit on all runs at one speed but the last, and apply the filter to that one."""
    *training, unseen = read_runs(data, [pattern])
    return sweep(training, [unseen])


def seen_table(data: Path) -> str:
    """Return the share of driving time in which a window sees the wheelbase delay."""
    lines = []
    for track in ("Heilbronn", "Rural", "Hockenheim"):
        runs = read_runs(data, [f"{track.lower()}_*_smooth_passive"])
        lines.append([track, *(f"{seen(runs, window):.0f}" for window in SEEN_WINDOWS)])
    return table(("laps of all drivers", *(f"W = {window}" for window in SEEN_WINDOWS)), lines)


def sweep_table(sweeps: Mapping[str, Sweep]) -> str:
    """Return the linear filter's accuracy by window."""
    lengths = list(next(iter(sweeps.values())).raw)
    lines = [
        [f"{surface}, {what}", *(percent(value) for value in values.values())]
        for surface, found in sweeps.items()
        for what, values in (("wheel speeds", found.raw), ("residuals", found.residual))
    ]
    return table(("surface, channels", *(f"W = {length}" for length in lengths)), lines)


def difference_values(smooth: Table4) -> Values:
    """Count rows above the paper's RMSE, and compare the references."""
    found = {row: smooth.figures(row)["overall"] for row in paper_rows()}
    worse = [row.scenario for row, ours in found.items() if ours["rmse"] > row.rmse_overall]
    by_split = {
        split: [row.scenario for row in paper_rows() if row.split == split] for split in SPLITS
    }
    ratios = [
        row.truth_rms / ours["truth_rms"] for row, ours in found.items() if row.split == "testing"
    ]
    return {
        "not_worse": len(found) - len(worse),
        "worse": len(worse),
        "worse_by_split": ", ".join(
            f"{sum(name in worse for name in names)} of {len(names)} {split}"
            for split, names in by_split.items()
        ),
        "least_ratio": f"{min(ratios):.1f}",
        "largest_ratio": f"{max(ratios):.0f}",
    }


if __name__ == "__main__":
    main()
