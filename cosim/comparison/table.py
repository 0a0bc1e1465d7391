"""The figures of runs side by side, changes against the first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from cosim.comparison.read import ComparedRun
from cosim.metrics import figure, unit_of
from cosim.tables import Table

COLUMNS: Final[Mapping[str, str]] = {
    "comfort.weighted_acceleration_m_s2": "a_w",
    "comfort.weighted_vertical_m_s2": "a_w vertical",
    "comfort.vibration_dose_m_s1_75": "VDV",
    "comfort.deflection_rms_m": "deflection rms",
    "comfort.tyre_load_rms_n": "tyre load rms",
    "comfort.roll_rms_deg": "roll rms",
    "comfort.pitch_rms_deg": "pitch rms",
    "comfort.roll_rate_rms_deg_s": "roll rate rms",
    "comfort.pitch_rate_rms_deg_s": "pitch rate rms",
    "comfort.damper_energy_j": "damper energy",
    "decisions.wrong_percent": "wrong decisions",
    "fallback.active_percent": "fallback active",
    "fallback.force_step_n": "fallback's force step",
    "against_truth.gain_kept_percent": "comfort gain kept",
    "against_truth.tyre_load_percent": "tyre load against truth's",
    "sensor.overall.rmse_m_s": "estimate's RMSE",
    "sensor.overall.accuracy_percent": "accuracy",
}
RELATIVE: Final = "comfort."
"""Figures of which the change against the first run is shown too."""
SAME_LENGTH: Final = 0.01
"""Share by which runs may differ in length, as laps do, without a word about it."""


def table_of(runs: Sequence[ComparedRun]) -> Table:
    """Return a row per run; figures that no run has are left out."""
    shown = [path for path in COLUMNS if any(figure(r.figures, path) is not None for r in runs)]
    titles = (f"{COLUMNS[path]} [{unit_of(path)}]" for path in shown)
    rows = [(r.name, *(_cell(runs[0].figures, r.figures, path) for path in shown)) for r in runs]
    note = f"Changes in % against {runs[0].name}."
    if len({run.scenario for run in runs}) > 1:
        note += " The runs are of different scenarios: read the changes with care."
    note += _lengths(runs)
    return Table("Runs compared", ("run", *titles), tuple(rows), note)


def _lengths(runs: Sequence[ComparedRun]) -> str:
    """Return a sentence where the runs are not about as long as each other, else nothing."""
    found = [figure(run.figures, "simulated_s") for run in runs]
    lengths = [length for length in found if length is not None]
    if not lengths or max(lengths) <= (1.0 + SAME_LENGTH) * min(lengths):
        return ""
    return (
        f" The runs last from {min(lengths):g} to {max(lengths):g} s; VDV and damper energy grow"
        " with time."
    )


def _cell(first: Mapping[str, Any], figures: Mapping[str, Any], path: str) -> str:
    value, base = figure(figures, path), figure(first, path)
    if value is None:
        return "-"
    text = f"{value:.4g}"
    if not path.startswith(RELATIVE) or not base or figures is first:
        return text
    return f"{text} ({100 * (value / base - 1):+.1f})"


def as_json(runs: Sequence[ComparedRun]) -> list[dict[str, Any]]:
    """Return the figures of the table for programs, None where a run has none."""
    return [
        {
            "run": run.name,
            "scenario": run.scenario,
            "folder": str(run.folder),
            "figures": {path: figure(run.figures, path) for path in COLUMNS},
        }
        for run in runs
    ]
