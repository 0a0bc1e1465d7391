"""What each fault does to the sensor: its error before, during and after it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from cosim.faults.window import Window
from cosim.recorder import Recorder
from sensor.channels import SAMPLE_RATE_HZ
from sensor.metrics import rms

if TYPE_CHECKING:
    from cosim.scenario.osp_scenario import Acting

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.bool_]

AROUND_S: Final = 5.0
"""How long before its start and after its end a fault is looked at [s]."""
BAND: Final = 1.645  # deviations that 90 % of a normal distribution lie within


def windows(entry: Acting) -> list[Window]:
    """Return the samples that an entry of the list of faults acts on."""
    return [Window.of(fault.start_s, fault.end_s) for fault in entry.faults]


def fault_figures(
    acting: Sequence[Acting], recorder: Recorder
) -> dict[str, dict[str, Mapping[str, float]]]:
    """Return the sensor's figures by fault and by part of the run: `AROUND_S` `before` the fault,
    `during` it, and as long `after` it. Parts without a row are left out.

    `recorder` has the groups estimate, deviation, valid and truth. `rmse_m_s` and `covered_percent`
    (errors within 1.645 predicted deviations) are of valid rows, `valid_percent` is the share of
    them.
    """
    return {
        entry.label: {
            part: _figures(recorder, rows)
            for part, rows in parts(windows(entry), recorder.rows).items()
            if rows.any()
        }
        for entry in acting
    }


def parts(acting: Sequence[Window], rows: int) -> dict[str, Rows]:
    """Return the rows before, during and after a fault that acts in these windows."""
    found = {name: np.zeros(rows, dtype=np.bool_) for name in ("before", "during", "after")}
    if not acting:
        return found
    for window in acting:
        found["during"][window.first : window.stop] = True
    around = round(AROUND_S * SAMPLE_RATE_HZ)
    start, end = min(w.first for w in acting), max(w.stop for w in acting)
    found["before"][max(start - around, 0) : start] = True
    found["after"][end : end + around] = True
    return found


def _figures(recorder: Recorder, rows: Rows) -> dict[str, float]:
    valid = recorder.group("valid")[:, 0] > 0
    figures = {"valid_percent": 100.0 * float(valid[rows].mean())}
    counted = rows & valid
    if not counted.any():
        return figures
    error = (recorder.group("estimate") - recorder.group("truth"))[counted]
    deviation = recorder.group("deviation")[counted]
    figures["rmse_m_s"] = rms(error)
    if np.isfinite(deviation).all():
        figures["covered_percent"] = 100.0 * float((np.abs(error) <= BAND * deviation).mean())
    return figures
