"""Every estimator on every case under both measurement conditions: `make evaluation`.

Writes docs/estimators-compared.md, its picture and the model cards from the evaluation's figures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
from ablations import ablation_text
from cases import CASES, Case
from evaluated import NAMES, ROOT, SURFACES, Evaluated, Record
from goals import Goals, best_of
from markdown_tables import fill, millimetres, percent, table
from model_cards import write_cards
from pictures import COLOURS, picture

from sensor.metrics import BANDS, MODES
from sensor.paper import paper_rows

PAGE = ROOT / "docs" / "estimators-compared.md"
PICTURE = ROOT / "docs" / "paper" / "estimators.svg"
DRAWN = ("fir_w19", "kalman", "smoother", "bilstm_w19", "bilstm_residual_w19", "carried")
LEAST_PART = 0.001
"""Rms [m/s] of a mode or band below which its accuracy says nothing."""


@click.command(help=__doc__)
@click.option("--evaluation", required=True, type=click.Path(exists=True, path_type=Path))
@click.option("--data", required=True, type=click.Path(exists=True, path_type=Path))
def main(evaluation: Path, data: Path) -> None:
    """Write the page."""
    evaluated = Evaluated.read(evaluation)
    draw_cases(PICTURE, evaluated)
    goals = Goals(evaluated, best_of(evaluated))
    values = {
        "runs": len(evaluated.runs),
        "minutes": f"{sum(record['samples'] for record in evaluated.runs) / 6000:.0f}",
        "commit": evaluated.commit,
        "best": NAMES[goals.best],
        "accuracies": goals.accuracies(),
        "flat_turns": goals.flat_turns(),
        "paper_rows": goals.rows_of_the_paper(),
        "robustness": goals.robustness(),
        "deviations": goals.deviations(),
        "cases": cases(evaluated),
        "ablation": ablation_text(data),
        "bands": ", ".join(f"{name} {low:g} to {high:g} Hz" for name, (low, high) in BANDS.items()),
        "parts": parts(evaluated),
        "rows": rows(evaluated),
    }
    fill(PAGE, values)
    write_cards(evaluated)


def cases(evaluated: Evaluated) -> str:
    """Return RMSE and accuracy of all estimators on all cases."""
    text = ""
    for condition in evaluated.conditions:
        lines = [_line(evaluated, case.label, evaluated.case(case), condition) for case in CASES]
        head = f"### {condition.capitalize()}: `RMSE; accuracy`"
        text += f"{head}\n\n{table(_header(evaluated, 'case'), lines)}\n"
    return text


def rows(evaluated: Evaluated) -> str:
    """Return the paper's 29 rows on every surface under both conditions."""
    text = ""
    for surface, words in SURFACES.items():
        for condition in evaluated.conditions:
            lines = [
                _line(evaluated, row.scenario, evaluated.runs_of(row, surface), condition)
                for row in paper_rows()
            ]
            text += f"### {words[0].upper()}{words[1:]}, {condition}\n\n"
            text += f"{table(_header(evaluated, 'row'), lines)}\n"
    return text


def _header(evaluated: Evaluated, first: str) -> list[str]:
    return [first, "truth rms", *(NAMES[name] for name in _moving(evaluated))]


def _line(evaluated: Evaluated, label: str, runs: Sequence[Record], condition: str) -> list[str]:
    truth = evaluated.pooled(runs, condition, "zero")["overall"]["rmse"]
    cells = [label, millimetres(truth)]
    for name in _moving(evaluated):
        overall = evaluated.pooled(runs, condition, name)["overall"]
        shown = percent(overall["accuracy"], overall["accuracy_meaningful"])
        cells.append(f"{millimetres(overall['rmse'])}; {shown}")
    return cells


def _moving(evaluated: Evaluated) -> list[str]:
    """All estimators but zero, whose RMSE is the truth's rms."""
    return [name for name in evaluated.estimators if name != "zero"]


def parts(evaluated: Evaluated) -> str:
    """Return accuracies by mode and band, signs and coverage, a table per case."""
    header = ("estimator", "condition", *MODES, *BANDS, "right sign", "covered")
    text = ""
    for case in CASES:
        runs = evaluated.case(case)
        truth = evaluated.pooled(runs, evaluated.conditions[0], "zero")
        lines = [["truth rms, mm/s", "", *_cells(truth, "truth_rms"), "", ""]]
        for condition in evaluated.conditions:
            for name in _moving(evaluated):
                found = evaluated.pooled(runs, condition, name)
                sign = percent(found["overall"]["sign_agreement"])
                tail = [sign, _covered(found["coverage"])]
                lines.append([NAMES[name], condition, *_cells(found, "accuracy"), *tail])
        text += f"### {case.label[0].upper()}{case.label[1:]}\n\n{table(header, lines)}\n"
    return text


def _cells(found: Record, what: str) -> list[str]:
    both: list[Mapping[str, Any]] = [*found["modes"].values(), *found["bands"].values()]
    if what == "truth_rms":
        return [millimetres(part[what]) for part in both]
    return [percent(part[what], part["truth_rms"] >= LEAST_PART) for part in both]


def _covered(share: Mapping[str, float] | None) -> str:
    return "-" if share is None else f"{min(share.values()):.0f} to {max(share.values()):.0f}"


def draw_cases(file: Path, evaluated: Evaluated) -> None:
    """Draw the accuracy of some estimators on every case, a panel per condition."""
    drawn = [name for name in DRAWN if name in evaluated.estimators]
    moving = [case for case in CASES if _moves(evaluated, case)]
    places = np.arange(len(moving))
    layout = {"figsize": (8.6, 4.6), "sharey": True, "sharex": True}
    with picture(file, ncols=len(evaluated.conditions), squeeze=False, **layout) as (figure, found):
        panels = found[0]
        for axes, condition in zip(panels, evaluated.conditions, strict=True):
            for name in drawn:
                values = [
                    evaluated.pooled(evaluated.case(case), condition, name)["overall"]["accuracy"]
                    for case in moving
                ]
                style = {"color": COLOURS[name], "label": NAMES[name], "markersize": 5}
                axes.plot(np.maximum(values, 0.0), places, "o", **style)
            goals = [
                (case.goal(condition), place) for case, place in zip(moving, places, strict=True)
            ]
            marks = [(goal.accuracy, place) for goal, place in goals if goal is not None]
            axes.plot(*np.array(marks).T, "k|", markersize=12, label="goal")
            axes.set(title=condition, xlabel="accuracy, %", xlim=(-2, 100))
        panels[0].set_yticks(places, [case.label for case in moving])
        panels[0].invert_yaxis()
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8)


def _moves(evaluated: Evaluated, case: Case) -> bool:
    """Whether the truth moves enough for an accuracy to say something."""
    found = evaluated.pooled(evaluated.case(case), evaluated.conditions[0], "zero")
    return bool(found["overall"]["accuracy_meaningful"])


if __name__ == "__main__":
    main()
