"""The project's goals beside what was measured, as tables."""

from __future__ import annotations

import json
from collections.abc import Sequence

from cases import CASES, FLAT, ROBUST, Case
from evaluated import NAMES, ROOT, Evaluated, Record
from markdown_tables import millimetres, percent, table

from sensor.metrics import COVERED_SHARE
from sensor.paper import PaperRow, paper_rows

BOUNDS = {
    "class A mix": "A at 50 km/h",
    "class B mix": "B at 50 km/h",
    "class B at 50 km/h": "B at 50 km/h",
    "class C at 50 km/h": "C at 50 km/h",
}
"""Cases of docs/bounds.json; a mix has the bound of its class at 50 km/h, straight on."""
PAPER_TESTING_ACCURACY = 95.0
MOST_LOSS = 5.0
COVERED = (85.0, 95.0)
FLAT_GOALS = {"ideal": 0.001, "production": 0.005}  # m/s


class Goals:
    """Goals for one estimator, the project's best network."""

    def __init__(self, evaluated: Evaluated, best: str) -> None:
        self._evaluated, self.best = evaluated, best

    def accuracies(self) -> str:
        """Accuracy and gap to the bound; the smaller demand counts."""
        rows = [
            self._accuracy(case, condition)
            for case in CASES
            for condition in self._evaluated.conditions
            if case.goals
        ]
        header = ("case", "condition", "goal", "prototype", NAMES[self.best], "bound",
                  "gap to the bound", "gap allowed", "")  # fmt: skip
        return table(header, rows)

    def _accuracy(self, case: Case, condition: str) -> list[str]:
        runs = self._evaluated.case(case)
        reached = self._evaluated.pooled(runs, condition, self.best)["overall"]["accuracy"]
        bound = self._bound(case, condition)
        goal = case.goal(condition)
        assert goal is not None
        demand = goal.accuracy if bound is None else min(goal.accuracy, bound - goal.gap)
        return [
            case.label,
            condition,
            f"{goal.accuracy:.0f}",
            goal.prototype,
            percent(reached),
            "-" if bound is None else percent(bound),
            "-" if bound is None else f"{bound - reached:.1f}",
            f"{goal.gap:.0f}",
            _word(reached >= demand),
        ]

    def _bound(self, case: Case, condition: str) -> float | None:
        """Return what the Riccati equation allows the linear car with delay and wheel speeds."""
        for one in json.loads((ROOT / "docs" / "bounds.json").read_text(encoding="utf-8")):
            if one["case"] == BOUNDS.get(case.label):
                return float(one["accuracy"][condition]["kalman"])
        return None

    def flat_turns(self) -> str:
        """RMSE where the suspension hardly moves."""
        runs = self._evaluated.case(FLAT)
        rows = []
        for condition in self._evaluated.conditions:
            reached = self._evaluated.pooled(runs, condition, self.best)["overall"]["rmse"]
            most = FLAT_GOALS[condition]
            cells = [f"at most {1e3 * most:.0f}", millimetres(reached), _word(reached <= most)]
            rows.append([FLAT.label, condition, *cells])
        return table(("case", "condition", "goal, mm/s", "RMSE, mm/s", ""), rows)

    def rows_of_the_paper(self) -> str:
        """The 29 rows, smooth and ideal: presumed target, and the suspension velocity itself."""
        best = {row: self._row(row, self.best) for row in paper_rows()}
        testing = [row for row in paper_rows() if row.split == "testing"]
        above = sum(best[row]["projected"]["accuracy"] >= row.accuracy for row in best)
        mean = _mean([best[row]["projected"]["accuracy"] for row in testing])
        alone = _mean([self._row(row, "zero")["projected"]["accuracy"] for row in testing])
        paper = _mean([row.accuracy for row in testing])
        below = sum(best[row]["overall"]["rmse"] <= row.rmse_overall for row in best)
        rows = [
            ["rows with at least the paper's accuracy on the presumed target", "29", f"{above}",
             _word(above == 29)],
            [f"mean accuracy of the 20 testing rows there (paper {paper:.1f}, v_x sin θ₀ alone "
             f"{alone:.1f}), %", f"{PAPER_TESTING_ACCURACY:.0f}", f"{mean:.1f}",
             _word(mean >= PAPER_TESTING_ACCURACY)],
            ["rows with at most the paper's RMSE on the suspension velocity", "29", f"{below}",
             _word(below == 29)],
        ]  # fmt: skip
        return table(("29 rows, smooth, ideal", "goal", "reached", ""), rows)

    def _row(self, row: PaperRow, estimator: str) -> Record:
        return self._evaluated.paper_row(row, "smooth", "ideal", estimator)

    def robustness(self) -> str:
        """Points lost with other dampers and a heavier car, against the same runs without."""
        rows = []
        for case, nominal in ROBUST:
            for condition in self._evaluated.conditions:
                usual, other = (
                    self._evaluated.pooled(self._evaluated.case(one), condition, self.best)
                    for one in (nominal, case)
                )
                accuracies = [one["overall"]["accuracy"] for one in (usual, other)]
                loss = accuracies[0] - accuracies[1]
                cells = [*map(percent, accuracies), f"{loss:.1f}", _word(loss <= MOST_LOSS)]
                rows.append([case.label, condition, *cells])
        header = ("case", "condition", "nominal car", "this car", "lost, at most 5", "")
        return table(header, rows)

    def deviations(self) -> str:
        """Share of errors within 1.645 predicted deviations, least and largest of the wheels."""
        rows = []
        for case in CASES:
            for condition in self._evaluated.conditions:
                runs = self._evaluated.case(case)
                share = self._evaluated.pooled(runs, condition, self.best)["coverage"]
                if share is None:
                    continue
                low, high = min(share.values()), max(share.values())
                word = _word(COVERED[0] <= low and high <= COVERED[1])
                rows.append([case.label, condition, f"{low:.1f} to {high:.1f}", word])
        if not rows:
            return f"{NAMES[self.best]} predicts no deviation.\n"
        return table(("case", "condition", f"held by the {COVERED_SHARE:.0f} % band, %", ""), rows)


def best_of(evaluated: Evaluated) -> str:
    """The network that the goals are held against: the carried one as soon as there is one."""
    order = ("carried", "bilstm_residual_w19", "bilstm_w19")
    return next((name for name in order if name in evaluated.estimators), evaluated.estimators[-1])


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def _word(reached: bool) -> str:
    return "reached" if reached else "**not reached**"
