"""Comfort over tyre load of the runs of several scenarios, against the passive car."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pictures import picture

COMFORT, LOAD = "weighted_acceleration_m_s2", "tyre_load_rms_n"
# Runs on every picture: how they are drawn. Filled: plain skyhook; open: the cautious law.
DRAWN = {
    "passive": ("passive", "k", "+", "none"),
    "fixed_soft": ("fixed soft", "tab:gray", "v", "tab:gray"),
    "skyhook_truth": ("skyhook, truth", "k", "o", "k"),
    "skyhook_carried": ("skyhook, carried", "tab:red", "o", "tab:red"),
    "skyhook_bilstm_w19": ("skyhook, bilstm_w19", "tab:blue", "o", "tab:blue"),
    "skyhook_kalman": ("skyhook, kalman", "tab:green", "o", "tab:green"),
    "cautious_skyhook_truth": ("cautious, truth", "k", "D", "none"),
    "cautious_skyhook_carried": ("cautious, carried", "tab:red", "D", "none"),
    "cautious_skyhook_kalman": ("cautious, kalman", "tab:green", "D", "none"),
}


def draw_planes(file: Path, planes: Mapping[tuple[str, str], Mapping[str, Any]]) -> None:
    """Draw the runs of each (scenario, condition): scenarios in columns, conditions in rows."""
    titles = list(dict.fromkeys(title for title, _ in planes))
    conditions = list(dict.fromkeys(condition for _, condition in planes))
    size = (2.6 * len(titles), 2.6 * len(conditions) + 0.6)
    grid = {"nrows": len(conditions), "ncols": len(titles), "sharex": "col", "sharey": "col"}
    with picture(file, figsize=size, squeeze=False, **grid) as (figure, axes):
        for (title, condition), runs in planes.items():
            ax = axes[conditions.index(condition), titles.index(title)]
            _draw(ax, runs)
            if condition == conditions[0]:
                ax.set_title(title)
            else:
                ax.set_xlabel("dynamic tyre load, %")
            if title == titles[0]:
                ax.set_ylabel(f"{condition}\nweighted acceleration a_w, %")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=5)


def _draw(ax: Any, runs: Mapping[str, Any]) -> None:
    """Draw one plane: changes [%] against the passive run, better below and to the left."""
    passive = runs["passive"]["comfort"]
    for run, (label, colour, marker, filled) in DRAWN.items():
        comfort = runs[run]["comfort"]
        x, y = (100.0 * (comfort[name] / passive[name] - 1.0) for name in (LOAD, COMFORT))
        ax.plot(x, y, marker, color=colour, markerfacecolor=filled, label=label, markersize=6)
