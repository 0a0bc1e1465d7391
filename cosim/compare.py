"""From a record to figures: sensor and baselines against the truth, on the same samples."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.metrics import BASELINES, WHEELS
from cosim.recorder import Recorder, held
from sensor import SensorError, evaluate
from sensor.conditions import Condition
from sensor.estimator import Estimator
from sensor.estimators import make
from sensor.metrics import rms
from sensor.missing import HeldSamples
from sensor.paper import paper_rows

Array = npt.NDArray[np.float64]


def compare(
    recorder: Recorder, initial_command: Array, condition: Condition = "ideal"
) -> dict[str, Any]:
    """Return the figures of every estimator, per wheel and overall, and the rms of the truth.

    `recorder` has the groups channels (rows, 14), estimate (rows, 4) [m/s], valid (rows, 1), truth
    (rows, 4) [m/s] and command (rows, 4), `initial_command` (4,) is the one before the first. Only
    rows where the sensor is valid and every estimate exists count, the same for all. Without such
    a row there are no figures but `valid_samples`, which is 0.
    """
    truth, estimates, rows = estimates_of(recorder, initial_command, condition)
    figures: dict[str, Any] = {"valid_samples": int(rows.sum())}
    if not rows.any():
        return figures
    for name, estimate in estimates.items():
        figures[name] = _figures(estimate, truth, rows)
    figures["truth"] = _truth(truth[rows])
    return figures


def estimates_of(
    recorder: Recorder, initial_command: Array, condition: Condition = "ideal"
) -> tuple[Array, dict[str, Array], npt.NDArray[np.bool_]]:
    """Return the truth and each estimator's velocities (rows, 4) [m/s], and the rows that count.

    Where a channel is missing in some rows, the baselines bridge that as the sensor does.
    """
    channels, truth = recorder.group("channels"), recorder.group("truth")
    estimates = {"sensor": recorder.group("estimate")}
    rows = recorder.group("valid")[:, 0] > 0
    if len(channels):
        commands = held(recorder.group("command"), initial_command)
        gaps = not np.isfinite(channels).all()
        estimates |= {
            name: (HeldSamples(b) if gaps else b).apply(channels, commands)
            for name, b in _baselines(condition).items()
        }
    for estimate in estimates.values():
        rows = rows & np.isfinite(estimate).all(axis=1)
    return truth, estimates, rows


def paper_figures(name: str | None) -> dict[str, Any] | None:
    """Return a row of the paper's Table 4 in the shape of an estimator's figures; None for None."""
    row = next((row for row in paper_rows() if row.scenario == name), None)
    if row is None:
        return None
    wheels = {wheel: {"rmse_m_s": rmse} for wheel, rmse in zip(WHEELS, row.rmse, strict=True)}
    overall = {"rmse_m_s": row.rmse_overall, "accuracy_percent": row.accuracy}
    return {"row": row.scenario, "split": row.split, **wheels, "overall": overall}


def _baselines(condition: Condition) -> dict[str, Estimator]:
    """Return the baselines that this installation has; the fitted filter is shipped or is not."""
    baselines = {}
    for name, estimator in BASELINES.items():
        with suppress(SensorError):
            baselines[name] = make(estimator, condition)
    return baselines


def _figures(estimate: Array, truth: Array, rows: npt.NDArray[np.bool_]) -> dict[str, Any]:
    found = evaluate(estimate, truth, rows)
    parts = dict(zip(WHEELS, found.wheels, strict=True)) | {"overall": found.overall}
    return {
        part: {
            "rmse_m_s": f.rmse,
            "nrmse": f.nrmse,
            "accuracy_percent": f.accuracy,
            "accuracy_meaningful": f.accuracy_meaningful,
            "max_abs_error_m_s": f.max_abs_error,
            "error_low_m_s": f.error_low,
            "error_high_m_s": f.error_high,
            "sign_agreement_percent": f.sign_agreement,
        }
        for part, f in parts.items()
    }


def _truth(truth: Array) -> dict[str, dict[str, float]]:
    parts = {wheel: truth[:, [i]] for i, wheel in enumerate(WHEELS)} | {"overall": truth}
    return {part: {"rms_m_s": rms(values)} for part, values in parts.items()}
