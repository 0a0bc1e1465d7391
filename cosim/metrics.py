"""Names and units of the figures in metrics.json, known before anything runs.

metrics.json is `{"scenario", "sensor": its settings, "runs": {label: figures}, "limits": [...],
"paper": {...} or null}`. In a run, `sensor` are the figures of the scenario's estimator, and the
baselines stand beside it.
A limit names a figure by its dotted path within a run, such as `sensor.overall.accuracy_percent`;
it is checked in every run, unless it begins with the name of one run:
`skyhook_estimate.comfort.tyre_load_rms_n`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

WHEELS: Final = ("FL", "FR", "RL", "RR")
PARTS: Final = (*WHEELS, "overall")
BASELINES: Final = {"fir": "fir_w19", "body_motion": "body_motion", "zero": "zero"}
"""What stands beside the sensor in every run, and its name among the estimators."""
ESTIMATORS: Final = ("sensor", *BASELINES)
ERROR_FIGURES: Final = (
    "rmse_m_s",
    "nrmse",
    "accuracy_percent",
    "max_abs_error_m_s",
    "error_low_m_s",
    "error_high_m_s",
    "sign_agreement_percent",
)
COMFORT_FIGURES: Final = (
    "weighted_acceleration_m_s2",
    "weighted_vertical_m_s2",
    "vibration_dose_m_s1_75",
    "deflection_rms_m",
    "tyre_load_rms_n",
    "roll_rms_deg",
    "pitch_rms_deg",
    "roll_rate_rms_deg_s",
    "pitch_rate_rms_deg_s",
    "damper_energy_j",
)
CONTROL_FIGURES: Final = (
    "decisions.wrong_percent",
    "fallback.active_percent",
    "fallback.times",
    "fallback.force_step_n",
    "against_truth.gain_kept_percent",
    "against_truth.tyre_load_percent",
    "against_truth.deflection_percent",
)
GRIP_FIGURES: Final = ("peak_percent", "mean_percent")
BUS_FIGURES: Final = (
    "samples",
    "answers_in_time",
    "late_answers",
    "unanswered_samples",
    "values_out_of_range",
    "frames_lost",
    "frames_lost_to_sensor",
    "frames_lost_from_sensor",
    *(f"{what}_{part}_ms" for what in ("latency", "age") for part in ("p50", "p99", "max")),
)
RUN_FIGURES: Final = (
    "lap_time_s",
    "largest_deviation_m",
    "simulated_s",
    "wall_time_s",
    "real_time_factor",
    "valid_samples",
)
FAULT_PARTS: Final = ("before", "during", "after")
"""Parts of the run that the figures of a fault are of; 5 s before and after it."""
FAULT_FIGURES: Final = ("rmse_m_s", "valid_percent", "covered_percent")
STEP_TIMES: Final = ("step_p50_ms", "step_p99_ms", "step_max_ms")
LATENESS: Final = ("lateness_p50_ms", "lateness_p99_ms", "lateness_max_ms", "overruns")
"""Figures of runs in real time, and of no other."""
_HELD: Final = ("speed_mean_kmh", "speed_deviation_kmh", "path_deviation_m")
_LARGEST: Final = ("path_deviation_m", "lateral_acceleration_max_m_s2", "yaw_rate_max_deg_s")
_CHANGE: Final = ("start_speed_kmh", "time_s", "distance_m", "path_deviation_m", "yaw_change_deg")
# By the manoeuvre's kind; what they are is told where they are computed, in cosim.manoeuvre.
MANOEUVRE_FIGURES: Final = {
    "constant_speed": _HELD,
    "constant_radius": (
        *_HELD,
        "lateral_acceleration_m_s2",
        "side_slip_deg",
        "steering_wheel_deg",
        "yaw_rate_deg_s",
    ),
    "double_lane_change": ("clearance_m", "entry_speed_kmh", "exit_speed_kmh", *_LARGEST),
    "slalom": ("clearance_m", "speed_mean_kmh", "speed_deviation_kmh", *_LARGEST),
    "sine_with_dwell": (
        "start_speed_kmh",
        "yaw_rate_peak_deg_s",
        "yaw_rate_after_1_00_s_percent",
        "yaw_rate_after_1_75_s_percent",
        "lateral_displacement_m",
        "lateral_acceleration_max_m_s2",
    ),
    "step_steer": (
        "start_speed_kmh",
        "steering_wheel_deg",
        "yaw_rate_deg_s",
        "yaw_gain_per_s",
        "yaw_response_time_s",
        "yaw_peak_time_s",
        "yaw_overshoot_percent",
        "lateral_acceleration_m_s2",
        "lateral_acceleration_response_time_s",
    ),
    "brake": (*_CHANGE, "mean_deceleration_m_s2"),
    "accelerate": (*_CHANGE, "mean_acceleration_m_s2"),
    "mix": ("speed_mean_kmh", *_LARGEST),
}

# A unit is read off the end of a figure's name; of two endings that fit, the first here counts.
UNITS: Final = {
    "_m_s2": "m/s²",
    "_m_s1_75": "m/s¹·⁷⁵",
    "_m_s": "m/s",
    "_deg_s": "°/s",
    "_per_s": "1/s",
    "_percent": "%",
    "_deg": "°",
    "_kmh": "km/h",
    "_ms": "ms",
    "_s": "s",
    "_n": "N",
    "_j": "J",
    "_m": "m",
}


def unit_of(metric: str) -> str:
    """Return the unit that the name of a figure ends with, or an empty text."""
    return next((unit for ending, unit in UNITS.items() if metric.endswith(ending)), "")


def with_unit(value: float, metric: str) -> str:
    """Return a figure to four digits with its unit, as shown to people."""
    return f"{value:.4g} {unit_of(metric)}".rstrip()


def metric_names(
    labels: Sequence[str] = (), manoeuvre: str | None = None, faults: Sequence[str] = ()
) -> list[str]:
    """Return every path that a limit may name, with those of the runs in `labels`, of a kind of
    manoeuvre, and of the faults by their labels.
    """
    names = [*RUN_FIGURES]
    names += [f"truth.{part}.rms_m_s" for part in PARTS]
    names += [
        f"{estimator}.{part}.{figure}"
        for estimator in ESTIMATORS
        for part in PARTS
        for figure in ERROR_FIGURES
    ]
    names += [f"comfort.{figure}" for figure in COMFORT_FIGURES]
    names += CONTROL_FIGURES
    names += [f"grip.{wheel}.{figure}" for wheel in WHEELS for figure in GRIP_FIGURES]
    names += [f"timing.{figure}" for figure in (*STEP_TIMES, *LATENESS)]
    names += [f"bus.{figure}" for figure in BUS_FIGURES]
    names += [f"manoeuvre.{figure}" for figure in MANOEUVRE_FIGURES.get(manoeuvre or "", ())]
    names += [
        f"faults.{f}.{part}.{n}" for f in faults for part in FAULT_PARTS for n in FAULT_FIGURES
    ]
    return names + [f"{label}.{name}" for label in labels for name in names]


def figure(figures: Mapping[str, Any], path: str) -> float | None:
    """Return the figure at a dotted path, or None where the run has none."""
    here: Any = figures
    for part in path.split("."):
        if not isinstance(here, Mapping) or part not in here:
            return None
        here = here[part]
    return float(here) if isinstance(here, int | float) else None
