"""The tables that people read, as text cells: the same ones on the terminal and in the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from cosim.metrics import (
    ESTIMATORS,
    PARTS,
    WHEELS,
    figure,
    unit_of,
    with_unit,
)
from cosim.verdict import Verdict
from sensor.metrics import LEAST_TRUTH_RMS

if TYPE_CHECKING:
    from cosim.batch import Ended

NAMES: Final = {
    "sensor": "Sensor",
    "fir": "Linear FIR",
    "body_motion": "Body motion only",
    "zero": "Zero",
}
COMFORT_NAMES: Final = {
    "weighted_acceleration_m_s2": "ISO 2631-1 weighted acceleration",
    "vibration_dose_m_s1_75": "Vibration dose",
    "deflection_rms_m": "Suspension deflection rms",
    "tyre_load_rms_n": "Dynamic tyre load rms",
}
CONTROL_NAMES: Final = {
    "decisions.wrong_percent": "wrong decisions",
    "against_truth.gain_kept_percent": "comfort gain kept",
}
MANOEUVRE_NAMES: Final = {
    "clearance_m": "Smallest clearance to the cones",
    "entry_speed_kmh": "Speed at the entry",
    "exit_speed_kmh": "Speed at the exit",
    "start_speed_kmh": "Speed at the beginning",
    "speed_mean_kmh": "Mean speed",
    "speed_deviation_kmh": "Largest deviation from the speed",
    "path_deviation_m": "Largest deviation from the path",
    "lateral_acceleration_m_s2": "Steady lateral acceleration",
    "lateral_acceleration_max_m_s2": "Largest lateral acceleration",
    "lateral_acceleration_response_time_s": "Response time of the lateral acceleration",
    "lateral_displacement_m": "Lateral displacement 1.07 s after beginning of steer",
    "side_slip_deg": "Side slip angle",
    "steering_wheel_deg": "Steering-wheel angle",
    "yaw_rate_deg_s": "Steady yaw rate",
    "yaw_rate_max_deg_s": "Largest yaw rate",
    "yaw_rate_peak_deg_s": "Peak yaw rate after the reversal",
    "yaw_rate_after_1_00_s_percent": "Yaw rate 1.00 s after completion of steer, of the peak",
    "yaw_rate_after_1_75_s_percent": "Yaw rate 1.75 s after completion of steer, of the peak",
    "yaw_gain_per_s": "Yaw rate per steering-wheel angle",
    "yaw_response_time_s": "Response time of the yaw rate",
    "yaw_peak_time_s": "Peak response time of the yaw rate",
    "yaw_overshoot_percent": "Overshoot of the yaw rate",
    "yaw_change_deg": "Largest change of the yaw angle",
    "time_s": "Time",
    "distance_m": "Distance",
    "mean_deceleration_m_s2": "Mean fully developed deceleration",
    "mean_acceleration_m_s2": "Mean acceleration",
}


@dataclass(frozen=True)
class Table:
    """Rows of text below a title; the first column names the row, the others are figures."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""


def number(value: float | None, digits: int = 4) -> str:
    """Return a figure with so many decimals, or a dash for none."""
    return "-" if value is None else f"{value:.{digits}f}"


def estimate_table(
    figures: Mapping[str, Any],
    paper: Mapping[str, Any] | None = None,
    sensor: Mapping[str, str] | None = None,
) -> Table:
    """Return the errors of sensor and baselines at each wheel, and the paper's row if any.

    `sensor` are the settings in metrics.json: its estimator or network, and the condition.
    """
    columns = (
        "estimate",
        *PARTS,
        "accuracy [%]",
        "95 % of errors [m/s]",
        "max [m/s]",
    )
    rows = []
    for estimator in ESTIMATORS:
        rmse = [figure(figures, f"{estimator}.{part}.rmse_m_s") for part in PARTS]
        if all(value is None for value in rmse):
            continue
        accuracy = figure(figures, f"{estimator}.overall.accuracy_percent")
        largest = figure(figures, f"{estimator}.overall.max_abs_error_m_s")
        band = [figure(figures, f"{estimator}.overall.error_{end}_m_s") for end in ("low", "high")]
        between = f"{band[0]:+.4f} … {band[1]:+.4f}" if None not in band else "-"
        cells = (*map(number, rmse), number(accuracy, 1), between, number(largest))
        rows.append((NAMES[estimator], *cells))
    if paper:
        rmse = [figure(paper, f"{part}.rmse_m_s") for part in PARTS]
        accuracy = figure(paper, "overall.accuracy_percent")
        cells = (*map(number, rmse), number(accuracy, 1), "-", "-")
        rows.append(("Paper's network", *cells))
    truth = [figure(figures, f"truth.{part}.rms_m_s") for part in PARTS]
    rows.append(("Truth, rms", *map(number, truth), "", "", ""))
    quiet = truth[-1] is not None and truth[-1] < LEAST_TRUTH_RMS
    notes = [_sensor_note(sensor)] if sensor else []
    if quiet:
        notes.append(f"The truth is below {LEAST_TRUTH_RMS} m/s rms: only the RMSE counts.")
    title = "RMSE of the estimate at each wheel [m/s]"
    return Table(title, columns, tuple(rows), " ".join(notes))


def _sensor_note(sensor: Mapping[str, Any]) -> str:
    name = next(sensor[kind] for kind in ("estimator", "network", "fmu") if sensor.get(kind))
    return f"Sensor: {name}, channels measured in condition {sensor['condition']}."


def comparison_table(runs: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return comfort, deflection, tyre load and decisions of each run beside its estimate.

    Percentages are changes against the first run.
    """
    columns = (
        "run",
        *(f"{title} [{unit_of(name)}]" for name, title in COMFORT_NAMES.items()),
        *(f"{title} [{unit_of(name)}]" for name, title in CONTROL_NAMES.items()),
        "estimate RMSE [m/s]",
        "estimate accuracy [%]",
    )
    first = next(iter(runs.values()))
    rows = []
    for label, figures in runs.items():
        comfort = [_against(first, figures, f"comfort.{name}") for name in COMFORT_NAMES]
        control = [number(figure(figures, name), 1) for name in CONTROL_NAMES]
        rmse = figure(figures, "sensor.overall.rmse_m_s")
        accuracy = figure(figures, "sensor.overall.accuracy_percent")
        rows.append((label, *comfort, *control, number(rmse), number(accuracy, 1)))
    return Table("Controllers compared", columns, tuple(rows))


def manoeuvre_table(runs: Mapping[str, Mapping[str, Any]]) -> Table | None:
    """Return the figures of the manoeuvre and the tyres' peak shares of grip, a column per run;
    None without a manoeuvre.
    """
    names = dict.fromkeys(name for run in runs.values() for name in run.get("manoeuvre", {}))
    if not names:
        return None
    rows = []
    for name in names:
        values = [figure(run, f"manoeuvre.{name}") for run in runs.values()]
        cells = ("-" if value is None else with_unit(value, name) for value in values)
        rows.append((MANOEUVRE_NAMES[name], *cells))
    grip = [_grip(run) for run in runs.values()]
    if any(grip):
        rows.append((f"Peak share of grip, {' '.join(WHEELS)}", *(cell or "-" for cell in grip)))
    return Table("Manoeuvre", ("figure", *runs), tuple(rows))


def _grip(run: Mapping[str, Any]) -> str:
    """Return the peak share of grip of each wheel in %, or nothing."""
    peaks = [figure(run, f"grip.{wheel}.peak_percent") for wheel in WHEELS]
    return "" if None in peaks else " ".join(number(peak, 0) for peak in peaks) + " %"


def verdict_table(verdicts: Sequence[Verdict]) -> Table:
    """Return one row per limit and run."""
    rows = tuple(
        (v.metric, v.run, v.measured, v.required, "passed" if v.passed else "FAILED")
        for v in verdicts
    )
    return Table("Limits", ("metric", "run", "measured", "required", "verdict"), rows)


def batch_table(ended: Sequence[Ended]) -> Table:
    """Return one row per run of several scenarios."""
    columns = (
        "scenario",
        "verdict",
        "simulated [s]",
        "times real time",
        "sensor RMSE [m/s]",
        "accuracy [%]",
        "largest deviation [m]",
    )
    rows: list[tuple[str, ...]] = []
    for one in ended:
        file = str(one.job.scenario)
        if not one.runs:
            rows.append((file, "error" if one.exit_code > 1 else "FAILED", *["-"] * 5))
        for run in one.runs:
            name = file if len(one.runs) == 1 else f"{file} ({run.label})"
            rows.append((name, verdict_of(one, run.label), *_cells(one, run.label)))
    return Table("Scenarios", columns, tuple(rows))


def verdict_of(ended: Ended, label: str) -> str:
    """Return in a word what came of a run of a scenario."""
    if ended.metrics is None or label not in ended.metrics["runs"]:
        return "error"
    own = [verdict["passed"] for verdict in ended.metrics["limits"] if verdict["run"] == label]
    return ("passed" if all(own) else "FAILED") if own else "no limits"


def _cells(ended: Ended, label: str) -> tuple[str, ...]:
    figures = ended.metrics["runs"].get(label, {}) if ended.metrics is not None else {}
    return (
        number(figure(figures, "simulated_s"), 1),
        number(figure(figures, "real_time_factor"), 1),
        number(figure(figures, "sensor.overall.rmse_m_s")),
        number(figure(figures, "sensor.overall.accuracy_percent"), 1),
        number(figure(figures, "largest_deviation_m"), 2),
    )


def _against(first: Mapping[str, Any], figures: Mapping[str, Any], path: str) -> str:
    value, base = figure(figures, path), figure(first, path)
    if value is None:
        return "-"
    change = f" ({100 * (value / base - 1):+.1f} %)" if base and first is not figures else ""
    return f"{value:.3g}{change}"


def plain(table: Table) -> str:
    """Return the table as lines of text, numbers to the right."""
    lines = [table.columns, *table.rows]
    widths = [max(len(row[i]) for row in lines) for i in range(len(table.columns))]
    text = [table.title]
    for first, *figures in lines:
        cells = [first.ljust(widths[0])]
        cells += [cell.rjust(width) for cell, width in zip(figures, widths[1:], strict=True)]
        text.append("  " + "  ".join(cells).rstrip())
    return "\n".join([*text, table.note] if table.note else text)
