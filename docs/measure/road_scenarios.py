"""The sensor off the roads that it was trained on: a table of docs/roads.md.

`python docs/measure/road_scenarios.py` runs scenarios/road in two processes and prints Markdown.
About a minute.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cosim.batch import find_scenarios, plan, run_all
from cosim.metrics import figure

FOLDER = Path(__file__).parents[2] / "scenarios" / "road"
PROCESSES = 2


def cell(run: Mapping[str, Any], estimator: str) -> str:
    """Return RMSE [mm/s] and accuracy [%] of an estimator."""
    rmse = figure(run, f"{estimator}.overall.rmse_m_s")
    accuracy = figure(run, f"{estimator}.overall.accuracy_percent")
    return "-" if rmse is None or accuracy is None else f"{1e3 * rmse:.1f}; {accuracy:.0f}"


def main() -> None:
    """Print the table."""
    files, _ = find_scenarios([FOLDER])
    print("| scenario | truth, rms mm/s | a_w, m/s2 | network | FIR | body motion |")
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        ended, _ = run_all(plan(files, Path(folder)), PROCESSES)
        for one in ended:
            if one.metrics is None:
                raise SystemExit("\n".join(one.problems))
            run = one.metrics["runs"]["passive"]
            truth = 1e3 * run["truth"]["overall"]["rms_m_s"]
            ride = run["comfort"]["weighted_acceleration_m_s2"]
            cells = " | ".join(cell(run, name) for name in ("sensor", "fir", "body_motion"))
            print(f"| `{one.job.scenario.stem}` | {truth:.0f} | {ride:.2f} | {cells} |")


if __name__ == "__main__":
    main()
