"""The scenarios with faults and latencies: docs/faults.md.

`make faults`, or `python docs/measure/fault_scenarios.py`, runs scenarios/faults in two processes
and writes the page. A few minutes.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from fault_statistics import rows
from markdown_tables import fill, millimetres, percent, table

from cosim.batch import find_scenarios, plan, run_all
from cosim.faults.shown import names, times
from cosim.metrics import figure
from cosim.scenario.load import load

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "scenarios" / "faults"
PROCESSES = 2
PARTS = ("before", "during", "after")


def results() -> dict[str, Mapping[str, Any]]:
    """Run the scenarios; return the figures of their runs by file name and run."""
    files, _ = find_scenarios([FOLDER])
    with tempfile.TemporaryDirectory() as folder:
        ended, _ = run_all(plan(files, Path(folder)), PROCESSES)
        for one in ended:
            if one.metrics is None:
                raise SystemExit("\n".join(one.problems))
    return {one.job.scenario.stem: one.metrics["runs"] for one in ended if one.metrics}


def around_faults(name: str, runs: Mapping[str, Any]) -> str:
    """Return the table of a scenario's faults, for its one run."""
    (run,) = runs.values()
    header = ["fault", "channels", "time, s", *PARTS, "valid, %", "covered, %"]
    lines = []
    for entry in load(FOLDER / f"{name}.yaml").acting_faults:
        found = run["faults"][entry.label]
        errors = [millimetres(figure(found, f"{part}.rmse_m_s")) for part in PARTS]
        shares = [percent(figure(found, f"during.{what}_percent")) for what in ("valid", "covered")]
        lines.append([entry.label, ", ".join(names(entry)), times(entry), *errors, *shares])
    return table(header, lines)


def late_estimates(runs: Mapping[str, Any]) -> str:
    """Return the table of an estimate that arrives late."""
    header = ["latency", "RMSE, mm/s", "accuracy, %"]
    lines = [
        [
            label.replace("_", " "),
            millimetres(figure(run, "sensor.overall.rmse_m_s")),
            percent(figure(run, "sensor.overall.accuracy_percent")),
        ]
        for label, run in runs.items()
    ]
    return table(header, lines)


def rides(runs: Mapping[str, Any]) -> str:
    """Return the table of a closed loop, against its first run."""
    header = ["run", "a_w, m/s²", "deflection, mm", "tyre load, N", "gain kept, %", "wrong, %"]
    return table(header, (list(_ride(label, run)) for label, run in runs.items()))


def _ride(label: str, run: Mapping[str, Any]) -> Iterator[str]:
    yield label.replace("_", " ")
    yield f"{run['comfort']['weighted_acceleration_m_s2']:.3f}"
    yield f"{1e3 * run['comfort']['deflection_rms_m']:.2f}"
    yield f"{run['comfort']['tyre_load_rms_n']:.0f}"
    yield percent(figure(run, "against_truth.gain_kept_percent"))
    yield percent(figure(run, "decisions.wrong_percent"))


def write(found: Mapping[str, Mapping[str, Any]]) -> None:
    """Write the page from the figures of the runs, by scenario."""
    values = {"statistics": table(["fault", "figure", "theory", "measured"], rows())}
    for name, runs in found.items():
        if name.startswith("latency_class_b"):
            values[name] = late_estimates(runs)
        elif name.startswith("skyhook"):
            values[name] = rides(runs)
        else:
            values[name] = around_faults(name, runs)
    fill(ROOT / "docs" / "faults.md", values)


if __name__ == "__main__":
    write(results())
