"""The report: one HTML file that needs no network, with the verdict, the figures and the signals.

The plots are drawn by uPlot, whose script and style are read from the installed `uplot-python`
package when the report is written; the signals lie in the page as base64 float32.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module, resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from cosim.errors import CosimError
from cosim.faults.shown import compared, fault_table, spans
from cosim.metrics import WHEELS
from cosim.recorder import Recorder
from cosim.tables import Table, comparison_table, estimate_table, manoeuvre_table

if TYPE_CHECKING:
    from cosim.run import Outcome, RunOutcome
    from cosim.scenario.osp_scenario import Acting

MS_TO_KMH = 3.6


class ReportError(CosimError):
    """The report cannot be written here; everything else can."""


def write_report(outcome: Outcome, versions: Mapping[str, Any], path: Path) -> None:
    """Write the report to `path`; raises `ReportError` where uplot-python is not installed."""
    script, style = uplot()
    acting = outcome.scenario.acting_faults
    page = _page().render(
        outcome=outcome,
        scenario=outcome.scenario,
        versions=versions,
        manoeuvre=manoeuvre_table({run.label: run.figures for run in outcome.runs}),
        comparison=_comparison(outcome),
        tables={run.label: _table(outcome, run) for run in outcome.runs},
        faults={run.label: fault_table(acting, run.figures) for run in outcome.runs},
        facts={run.label: facts(run) for run in outcome.runs},
        uplot_script=script,
        uplot_style=style,
        script=_template("report.js"),
        style=_template("report.css"),
        data=as_script({"runs": [_signals(run, acting) for run in outcome.runs]}),
    )
    path.write_text(page, encoding="utf-8")


@cache
def _page() -> Any:
    """Return the page's template, compiled once per process."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("cosim.report", "templates")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined)
    return environment.get_template("report.html")


def facts(run: RunOutcome) -> list[tuple[str, str]]:
    """Return the run in a few figures: how it ended, how long it took, how much of it counts."""
    figures = run.figures
    lap = figures["lap_time_s"]
    time = "Time of the manoeuvre" if figures["manoeuvre"] else "Lap time"
    valid, rows = figures["valid_samples"], run.recorder.rows
    return [
        ("Finished", figures["finish_reason"]),
        (time, "-" if lap is None else f"{lap:.2f} s"),
        ("Simulated", f"{figures['simulated_s']:.2f} s"),
        ("Speed of the run", f"{figures['real_time_factor']:.1f} times real time"),
        ("Valid samples", f"{valid} of {rows}"),
    ]


def _comparison(outcome: Outcome) -> Table | None:
    if len(outcome.runs) == 1:
        return None
    return comparison_table({run.label: run.figures for run in outcome.runs})


def _table(outcome: Outcome, run: RunOutcome) -> Table:
    return estimate_table(run.figures, outcome.metrics["paper"], outcome.sensor_of(run.label))


def _signals(run: RunOutcome, acting: Sequence[Acting]) -> dict[str, Any]:
    """Return truth, estimate, speed, damper command and faults of a run for the page's script."""
    recorder = run.recorder
    # A column of the estimate that is not valid yet is a gap in the plot, not a zero.
    estimate = np.where(recorder.group("valid") > 0, recorder.group("estimate"), np.nan)
    truth = recorder.group("truth")
    wheels = {
        wheel: {"truth": _base64(truth[:, i]), "estimate": _base64(estimate[:, i])}
        for i, wheel in enumerate(WHEELS)
    }
    command = recorder.group("command")
    commanded = len(command) > 0 and np.nanmax(command) > np.nanmin(command)
    return {
        "label": run.label,
        "rows": recorder.rows,
        "step": recorder.step_s,
        "wheels": wheels,
        "speed": _speed(recorder),
        "command": [_base64(column) for column in command.T] if commanded else None,
        "faults": spans(acting, recorder.rows, recorder.step_s),
        "channels": [
            {
                name: value if isinstance(value, str) else _base64(value)
                for name, value in one.items()
            }
            for one in (compared(acting, recorder) if acting else ())
        ],
    }


def _speed(recorder: Recorder) -> str | None:
    names = [signal.name for signal in recorder.signals_of("channels")]
    if "Car.vx" not in names:
        return None
    return _base64(recorder.car_channels(["Car.vx"])[:, 0] * MS_TO_KMH)


def _base64(column: npt.NDArray[np.float64]) -> str:
    return base64.b64encode(column.astype("<f4").tobytes()).decode("ascii")


def as_script(value: Any) -> str:
    """Return JSON that may stand inside a script element."""
    return json.dumps(value, allow_nan=False).replace("<", "\\u003c")


def _template(name: str) -> str:
    return (resources.files("cosim.report") / "templates" / name).read_text(encoding="utf-8")


def uplot() -> tuple[str, str]:
    """Return uPlot's script and style as installed."""
    try:
        static = resources.files(import_module("uplot")) / "static"
        script = (static / "uPlot.iife.js").read_text(encoding="utf-8")
        return script, (static / "uPlot.min.css").read_text(encoding="utf-8")
    except (ImportError, OSError):
        raise ReportError(
            "no report.html was written: it needs uplot-python; "
            "pip install 'suspension-cosim[report]'"
        ) from None
