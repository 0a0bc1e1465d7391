"""What can be known at all: docs/bounds.md and docs/bounds.json.

`python docs/measure/bounds.py --data DIR` solves the Riccati equation of the linear car for road
classes and speeds, runs the shipped filters over recorded straight runs in DIR, where there are
any, and writes the tables.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from cosim.kalman.bounds import CASES, bounds
from sensor import estimators
from sensor.conditions import CONDITIONS, Measurement
from sensor.dataset import read_runs
from sensor.kalman import Smoother

HERE = Path(__file__).parent.parent
NAMES = ("kalman_imu", "kalman_wheels", "kalman_delay", "kalman", "smoother")
RECORDED = {
    "B at 50 km/h": "straight_b_050_passive_*",
    "C at 50 km/h": "straight_c_050_passive_*",
    "B at 80 km/h": "straight_b_080_passive_*",
}
LENGTH, FIRST, LAST = 2500, 200, 100  # samples of a run; what is left out at its ends
HEAD = "| road | condition | nothing | wheel speeds | delay | both | both, smoother |"


def measured(directory: Path, pattern: str) -> dict[str, dict[str, float]]:
    """Return the accuracy [%] of the shipped filters by condition and name, over all runs."""
    runs = read_runs(directory, [pattern])
    found: dict[str, dict[str, float]] = {}
    for condition in CONDITIONS:
        found[condition] = {}
        for name in NAMES:
            pairs = []
            for seed, run in enumerate(runs):
                channels = Measurement(condition, seed).apply(run.channels, run.stage)[:LENGTH]
                if name == "smoother":
                    path = estimators.model_file("kalman", condition)
                    assert path is not None
                    estimator: Any = Smoother.load(path)
                else:
                    estimator = estimators.make(name, condition)
                estimate = estimator.apply(channels, run.commands[:LENGTH])
                pairs.append((estimate[FIRST:-LAST], run.truth[:LENGTH][FIRST:-LAST]))
            estimate, truth = (np.concatenate(part) for part in zip(*pairs, strict=True))
            error = np.sqrt(np.square(estimate - truth).mean() / np.square(truth).mean())
            found[condition][name] = 100.0 * (1.0 - float(error))
    return found


def rows(figures: dict[str, dict[str, float]], name: str) -> list[str]:
    """Return the lines of a table."""
    lines = []
    for condition, values in figures.items():
        cells = " | ".join(f"{values[column]:.0f}" for column in NAMES)
        lines.append(f"| {name} | {condition} | {cells} |")
    return lines


def main() -> None:
    """Write both files."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--data", type=Path, required=True)
    data = parser.parse_args().data
    results = [bounds(case) for case in CASES]
    for result in results:
        pattern = RECORDED.get(result["case"])
        if pattern and any(data.glob(f"{pattern}.parquet")):
            result["measured"] = measured(data, pattern)
    (HERE / "bounds.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    predicted = [HEAD, "|---|---|---|---|---|---|---|"]
    recorded = list(predicted)
    for result in results:
        label = f"{result['case']}, {1e3 * result['truth']:.0f} mm/s"
        predicted += rows(result["accuracy"], label)
        recorded += rows(result.get("measured", {}), result["case"])
    text = (HERE / "measure" / "bounds.md.in").read_text(encoding="utf-8")
    text = text.replace("@PREDICTED@", "\n".join(predicted))
    text = text.replace("@MEASURED@", "\n".join(recorded))
    (HERE / "bounds.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
