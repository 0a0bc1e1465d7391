"""Table 3 and Figures 5 and 6 of the paper beside the results of our search."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markdown_tables import table
from pictures import COLOURS, picture

from sensor.paper import search_rows

PAPER_SURFACE_WINDOW = 21
"""The window whose search the paper's Figure 5 shows."""
_PAPER, _OURS = COLOURS["paper"], COLOURS["bilstm_w19"]


class SearchResults:
    """What `cosim sensor search` found: a row per window, in ascending order."""

    def __init__(self, file: Path) -> None:
        content = json.loads(file.read_text(encoding="utf-8"))
        self.rows: Sequence[Mapping[str, Any]] = content["windows"]
        self.paper_shapes: Sequence[Mapping[str, Any]] = content["paper_shapes"]
        self.recipe: Mapping[str, Any] = content["recipe"]

    @property
    def trials(self) -> int:
        """Number of trainings over all windows."""
        return sum(len(row["trials"]) for row in self.rows)

    @property
    def hours(self) -> float:
        """Time of all trainings [h of one process]."""
        trials = [trial for row in self.rows for trial in row["trials"]]
        return sum(float(trial["seconds"]) for trial in trials) / 3600.0

    @property
    def best(self) -> Mapping[str, Any]:
        """The row of least RMSE."""
        return min(self.rows, key=lambda row: float(row["rmse"]))

    def verdict(self) -> str:
        """Say how the error goes with the window, and what that means."""
        least = float(self.best["rmse"])
        near = [str(row["window"]) for row in self.rows if row["rmse"] <= 1.03 * least]
        first = self.rows[0]
        gain = 100.0 * (1.0 - least / float(first["rmse"]))
        return (
            f"Against W = {first['window']} that is {gain:.0f} % less error (the paper: 53 %); "
            f"within 3 % of it are the windows {', '.join(near)}."
        )

    def table(self) -> str:
        """Table 3, each cell `paper / ours`."""
        ours = {row["window"]: row for row in self.rows}
        durations = {row["window"]: row for row in self.paper_shapes}
        header = (
            "window", "trials, ours", "BiLSTM units", "FC units", "RMSE, mm/s", "relative error, %",
            "relative duration, %", "duration of the paper's shape here, µs",
        )  # fmt: skip
        lines = []
        for paper in search_rows():
            row = ours.get(paper.window)
            here = durations.get(paper.window)
            lines.append([
                str(paper.window),
                "-" if row is None else str(len(row["trials"])),
                _pair(paper.units, row, "units", 0),
                _pair(paper.hidden, row, "hidden", 0),
                _pair(1e3 * paper.rmse, row, "rmse", 1, 1e3),
                _pair(paper.relative_error_percent, row, "relative_error_percent", 1),
                _pair(paper.relative_duration_percent, row, "relative_duration_percent", 1),
                "-" if here is None else f"{1e6 * here['duration_s']:.0f}",
            ])  # fmt: skip
        return table(header, lines)

    def figure_5(self, file: Path) -> int:
        """Draw the surface of one window and the course of its search; return the window: the
        paper's, or the one with the most trials.
        """
        with_surface = [row for row in self.rows if row["surface"]]
        row = max(
            with_surface,
            key=lambda one: (one["window"] == PAPER_SURFACE_WINDOW, len(one["trials"])),
        )
        with picture(file, ncols=2, figsize=(8.4, 3.5)) as (figure, (surface, course)):
            _draw_surface(figure, surface, row)
            _draw_course(course, row["trials"])
        return int(row["window"])

    def figure_6(self, file: Path) -> None:
        """Draw relative error and relative duration against the window, paper and ours."""
        with picture(file, ncols=2, figsize=(8.0, 3.2)) as (_, (errors, times)):
            windows = [row.window for row in search_rows()]
            error = [row.relative_error_percent for row in search_rows()]
            duration = [row.relative_duration_percent for row in search_rows()]
            errors.plot(windows, error, "o-", color=_PAPER, label="paper")
            times.plot(windows, duration, "o-", color=_PAPER, label="paper")
            own = [row["window"] for row in self.rows]
            for axes, name in (
                (errors, "relative_error_percent"),
                (times, "relative_duration_percent"),
            ):
                line = [row[name] for row in self.rows]
                axes.plot(own, line, "s-", color=_OURS, label="ours")
            shapes = [row["window"] for row in self.paper_shapes]
            line = [row["relative_duration_percent"] for row in self.paper_shapes]
            times.plot(shapes, line, "^--", color=_OURS, label="the paper's shapes here")
            errors.set(ylabel="relative error, %", ylim=(0, 110))
            times.set(ylabel="relative duration, %", yscale="log")
            for axes in (errors, times):
                axes.set(xlabel="window, samples of 10 ms")
                axes.legend(fontsize=8)


def _draw_surface(figure: Any, axes: Any, row: Mapping[str, Any]) -> None:
    surface, trials = row["surface"], row["trials"]
    mean = 1e3 * np.array(surface["mean"])
    levels = np.linspace(mean.min(), max(mean.max(), mean.min() + 0.1), 15)  # however flat it is
    shades = axes.contourf(surface["hidden"], surface["units"], mean, levels, cmap="viridis")
    figure.colorbar(shades, ax=axes, label="RMSE, mean of the process, mm/s")
    shape = ([trial["hidden"] for trial in trials], [trial["units"] for trial in trials])
    axes.plot(*shape, "o", color="white", markeredgecolor="black", markersize=4)
    axes.plot(row["hidden"], row["units"], "*", color="tab:red", markersize=12)
    axes.set(xlabel="FC units", ylabel="BiLSTM units", title=f"window {row['window']}")
    axes.grid(visible=False)


def _draw_course(axes: Any, trials: Sequence[Mapping[str, Any]]) -> None:
    ordered = sorted(trials, key=lambda trial: int(trial["number"]))
    rmse = 1e3 * np.array([trial["rmse"] for trial in ordered])
    number = np.arange(1, len(rmse) + 1)
    axes.plot(number, rmse, "o", color=_OURS, markersize=4, label="trial")
    axes.plot(number, np.minimum.accumulate(rmse), "-", color="tab:red", label="best so far")
    axes.set(xlabel="trial", ylabel="RMSE in validation, mm/s", title="course of the search")
    axes.legend(fontsize=8)


def _pair(
    paper: float, row: Mapping[str, Any] | None, name: str, digits: int, scale: float = 1.0
) -> str:
    ours = "-" if row is None else f"{scale * row[name]:.{digits}f}"
    return f"{paper:.{digits}f} / {ours}"
