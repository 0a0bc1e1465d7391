"""The nine laps on two surfaces, measured: `make figures`.

Writes docs/laps.md, and the figures by row that the model card shows.
"""

from __future__ import annotations

import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[2]
CARD_FIGURES = ROOT / "build" / "figures.json"
PAGE = ROOT / "docs" / "laps.md"
THETA0 = np.deg2rad(0.45)
INTRODUCTION = """\
# The nine laps

Written by `make figures`. RMSE over all four wheels in mm/s, then the accuracy of the paper's
equation 2 in %. FIR: linear ridge filter over the same 19 samples; body motion: wheels assumed
still; zero: no motion at all. Heilbronn and the rural road are the training tracks (here with
another surface seed and the passive dampers), Hockenheim is the validation track: the best
epoch was chosen on it. Sign right: share
of samples with a truth above 20 mm/s where the network has its sign. The paper's column comes from
another simulator, car and roads.

On smooth surfaces the RMSE is of the paper's size, the accuracy is not: its reference values
grow like 0.0079 v_x even on flat manoeuvres, as if its target held a projection of the speed.
"On v_rel + v_x sin 0.45 deg" gives the accuracies on that presumed target (the FMU's
`Car.PaperRelVel`), for the network with the known v_x sin 0.45 deg added, and for that projection
alone, which knows nothing of the suspension.
"""
HEADER = (
    "| lap | lap time, s | truth rms, mm/s | network | FIR | body motion | zero | paper "
    "| sign right, % | on v_rel + v_x sin 0.45 deg: network, projection alone, % |\n"
    "|---|---|---|---|---|---|---|---|---|---|\n"
)
ESTIMATORS = ("network", "fir", "body_motion", "zero")


@dataclass(frozen=True)
class Lap:
    """One lap's figures; `metrics` are `sensor.metrics.Metrics` by estimator."""

    name: str
    row: str
    surface: str
    lap_time_s: float | None
    deviation_m: float
    metrics: dict[str, Any]
    projection_rms: float  # rms of truth + v_x sin(theta0), m/s: the study's presumed target


def drive(file: Path) -> Lap:
    """Run one scenario and evaluate every estimator on the same samples."""
    from cosim.assembly import assemble
    from cosim.compare import estimates_of
    from cosim.scenario.load import load
    from sensor import evaluate

    scenario = load(file, [])
    assembly = assemble(scenario, scenario.controllers[0])
    result = assembly.run(None)
    truth, estimates, rows = estimates_of(assembly.recorder)
    metrics = {name: evaluate(estimates[name], truth, rows) for name in ESTIMATORS}
    surface = "smooth" if file.stem.endswith("smooth") else "class A"
    row = str(scenario.paper_row)
    speed = assembly.recorder.group("channels")[rows, 6:7]
    projected = float(np.sqrt(np.mean(np.square(truth[rows] + speed * np.sin(THETA0)))))
    return Lap(
        file.stem, row, surface, result.lap_time_s, result.largest_deviation_m, metrics, projected
    )


def main() -> None:
    """Drive all laps on two processes and write both files."""
    from sensor.model_card import figure_row

    files = sorted((ROOT / "scenarios" / "laps").glob("*.yaml"))
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as executor:
        laps = list(executor.map(drive, files))
    laps.sort(key=lambda lap: (lap.surface != "smooth", lap.row))
    rows = [figure_row(lap.row, lap.surface, lap.metrics) for lap in laps]
    CARD_FIGURES.parent.mkdir(exist_ok=True)
    CARD_FIGURES.write_text(json.dumps(rows, indent=2) + "\n", encoding="utf-8")
    PAGE.write_text(page(laps), encoding="utf-8")
    print(PAGE.read_text(encoding="utf-8"))


def page(laps: list[Lap]) -> str:
    """Return docs/laps.md."""
    text = INTRODUCTION
    from sensor.paper import paper_rows

    printed = {row.scenario: row for row in paper_rows()}
    for surface in ("smooth", "class A"):
        text += f"\n## Surface: {surface}\n\n{HEADER}"
        for lap in (one for one in laps if one.surface == surface):
            text += line(lap, printed[lap.row])
    return text


def line(lap: Lap, paper: Any) -> str:
    """Return one row of a table."""
    overall = {name: lap.metrics[name].overall for name in ESTIMATORS}
    cells = [f"{1e3 * o.rmse:.1f}; {o.accuracy:.1f}" for o in overall.values()]
    time = "not finished" if lap.lap_time_s is None else f"{lap.lap_time_s:.1f}"
    truth, sign = 1e3 * overall["network"].truth_rms, overall["network"].sign_agreement
    beside = f"{1e3 * paper.rmse_overall:.1f}; {paper.accuracy:.1f}"
    name = lap.row.replace(" track", "")
    on_target = [100 * (1 - overall[e].rmse / lap.projection_rms) for e in ("network", "zero")]
    row = [name, time, f"{truth:.1f}", *cells, beside, f"{sign:.1f}"]
    row.append(f"{on_target[0]:.1f}, {on_target[1]:.1f}")
    return f"| {' | '.join(row)} |\n"


if __name__ == "__main__":
    main()
