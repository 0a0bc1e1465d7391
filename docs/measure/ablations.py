"""Which channel carries what, as a section of docs/estimators-compared.md."""

from __future__ import annotations

from pathlib import Path

from cases import CONDITIONS, MIX_B, STRAIGHT_B
from markdown_tables import millimetres, percent, table

from sensor.ablation import ablation
from sensor.baselines.fit import FILTERS
from sensor.dataset import read_runs

FILTER = "fir_residual_w19"
TRAINING = ("heilbronn_*_class_b_passive", "rural_*_class_b_passive")


def ablation_text(data: Path) -> str:
    """Fit the filter again without each group of channels; return the table."""
    training = read_runs(data, TRAINING)
    lines: dict[str, list[str]] = {}
    header = ["without"]
    for case in (MIX_B, STRAIGHT_B):
        unseen = read_runs(data, [case.pattern])
        for condition in CONDITIONS:
            header.append(f"{case.label}, {condition}")
            for one in ablation(condition, training, unseen, FILTERS[FILTER]):
                cell = f"{millimetres(one.rmse)}; {percent(one.accuracy)}"
                lines.setdefault(one.without or "none: all channels", []).append(cell)
    return table(header, [[name, *cells] for name, cells in lines.items()])
