"""The tables of docs/paper.md: the paper's figures and ours in one cell, `paper / ours`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from evaluated import NAMES, Evaluated
from markdown_tables import millimetres, percent, table

from sensor.channels import OUTPUT_NAMES
from sensor.paper import PaperRow, paper_rows

NETWORK = "bilstm_w19"
BESIDE = ("zero", "body_motion", "fir_w19", "kalman", NETWORK, "bilstm_residual_w19", "carried")
SPLITS = ("training", "validation", "testing")


class Table4:
    """The 29 rows on one surface, measured ideally."""

    def __init__(self, evaluated: Evaluated, surface: str) -> None:
        self._evaluated, self.surface = evaluated, surface
        self.beside = [name for name in BESIDE if name in evaluated.estimators]

    def figures(self, row: PaperRow, estimator: str = NETWORK) -> Mapping[str, Any]:
        """One estimator's figures on a row."""
        return self._evaluated.paper_row(row, self.surface, "ideal", estimator)

    def as_in_the_paper(self) -> str:
        """The paper's Table 4, and ours in the same cells."""
        rows = [self._paper_row(row) for row in paper_rows()]
        header = ("row", *(name.split(".")[1] for name in OUTPUT_NAMES), "all wheels", "accuracy",
                  "reference rms")  # fmt: skip
        return table(header, [*rows, *self._means()])

    def _paper_row(self, row: PaperRow) -> list[str]:
        found = self.figures(row)
        ours = [found["wheels"][wheel]["rmse"] for wheel in OUTPUT_NAMES]
        overall = found["overall"]
        accuracy = percent(overall["accuracy"], overall["accuracy_meaningful"])
        return [
            row.scenario,
            *(f"{_tenth(p)} / {millimetres(o)}" for p, o in zip(row.rmse, ours, strict=True)),
            f"{_tenth(row.rmse_overall)} / {millimetres(overall['rmse'])}",
            f"{row.accuracy:.1f} / {accuracy}",
            f"{1e3 * row.truth_rms:.0f} / {millimetres(overall['truth_rms'])}",
        ]

    def _means(self) -> list[list[str]]:
        lines = []
        for split in (*SPLITS, "all"):
            rows = [row for row in paper_rows() if split in (row.split, "all")]
            ours = [self.figures(row)["overall"]["accuracy"] for row in rows]
            cell = f"{_mean([row.accuracy for row in rows])} / {_mean(ours)}"
            lines.append([_mean_of(split, len(rows)), *[""] * 5, cell, ""])
        return lines

    def on_the_truth(self) -> str:
        """RMSE and accuracy of every estimator shown beside the network."""
        rows = []
        for row in paper_rows():
            cells = [row.scenario, millimetres(self.figures(row)["overall"]["truth_rms"])]
            for name in self.beside[1:]:  # zero's RMSE is the truth's rms
                overall = self.figures(row, name)["overall"]
                shown = percent(overall["accuracy"], overall["accuracy_meaningful"])
                cells.append(f"{millimetres(overall['rmse'])}; {shown}")
            rows.append(cells)
        return table(("row", "truth rms = zero's RMSE", *self._heads(self.beside[1:])), rows)

    def on_presumed_target(self) -> str:
        """Accuracy on v_rel + v_x sin(theta0), the paper's beside."""
        rows = []
        for row in paper_rows():
            found = {name: self.figures(row, name)["projected"] for name in self.beside}
            target = found[self.beside[0]]["truth_rms"]
            cells = (percent(found[name]["accuracy"]) for name in self.beside)
            rms = f"{1e3 * row.truth_rms:.0f} / {1e3 * target:.0f}"
            rows.append([row.scenario, rms, f"{row.accuracy:.1f}", *cells])
        for split in (*SPLITS, "all"):
            chosen = [row for row in paper_rows() if split in (row.split, "all")]
            means = (
                _mean([self.figures(row, name)["projected"]["accuracy"] for row in chosen])
                for name in self.beside
            )
            paper = _mean([row.accuracy for row in chosen])
            rows.append([_mean_of(split, len(chosen)), "", paper, *means])
        heads = ("v_x sin θ₀ alone", *self._heads(self.beside[1:]))
        return table(("row", "target rms", "paper", *heads), rows)

    @staticmethod
    def _heads(estimators: Sequence[str]) -> list[str]:
        return [NAMES[name] for name in estimators]


def _tenth(value: float) -> str:
    """A velocity of the paper in mm/s, with its digits."""
    return f"{1e3 * value:.1f}"


def _mean_of(split: str, count: int) -> str:
    return (
        f"**mean of all {count} rows**" if split == "all" else f"**mean of {count} {split} rows**"
    )


def _mean(values: Sequence[float]) -> str:
    return f"{sum(values) / len(values):.1f}"
