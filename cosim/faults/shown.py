"""The faults of a run as people see them: a table, and what the report's plots need."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from cosim.faults.figures import windows
from cosim.faults.window import Window
from cosim.metrics import FAULT_PARTS, figure
from cosim.recorder import Recorder
from cosim.scenario.fault_channels import indices
from cosim.scenario.faults import PlainFault, SwappedWheels
from cosim.tables import Table, number
from sensor.channels import CHANNELS

if TYPE_CHECKING:
    from cosim.scenario.osp_scenario import Acting

_COLUMNS: Final = (
    "fault", "channels", "time [s]", *FAULT_PARTS, "valid during [%]", "covered during [%]",
)  # fmt: skip
_NOTE: Final = (
    "Error over all wheels in the samples that count: 5 s before the fault, during it, 5 s after. "
    "Covered: errors within 1.645 predicted deviations, 90 % of a normal distribution."
)


def fault_table(
    acting: Sequence[Acting], figures: Mapping[str, Any], run: str = ""
) -> Table | None:
    """Return the sensor's error before, during and after each fault of a run; None without any."""
    if not acting:
        return None
    rows = []
    for entry in acting:
        found = figures["faults"][entry.label]
        errors = (number(figure(found, f"{part}.rmse_m_s")) for part in FAULT_PARTS)
        shares = (
            number(figure(found, f"during.{name}_percent"), 1) for name in ("valid", "covered")
        )
        rows.append((entry.label, ", ".join(names(entry)), times(entry), *errors, *shares))
    title = "RMSE of the estimate around each fault [m/s]" + (f", {run}" if run else "")
    return Table(title, _COLUMNS, tuple(rows), _NOTE)


def names(entry: Acting) -> list[str]:
    """Return the channels and groups that an entry acts on, as the scenario names them."""
    return list(dict.fromkeys(name for fault in entry.faults for name in _names(fault)))


def times(entry: Acting) -> str:
    """Return from when to when an entry acts, in words, in s."""
    starts = [fault.start_s for fault in entry.faults]
    ends = [sys.float_info.max if f.end_s is None else f.end_s for f in entry.faults]
    if not starts:
        return "-"
    end = "end" if max(ends) == sys.float_info.max else f"{max(ends):g}"
    return f"{min(starts):g} to {end}"


def spans(acting: Sequence[Acting], rows: int, step_s: float) -> list[tuple[float, float]]:
    """Return the times at which any fault acts, as (start, end) in s, those that touch as one."""
    edges: list[tuple[int, int]] = []
    for window in sorted((w for entry in acting for w in windows(entry)), key=_first):
        start, stop = window.first, min(window.stop, rows)
        if start >= stop:
            continue
        if edges and start <= edges[-1][1]:
            edges[-1] = edges[-1][0], max(stop, edges[-1][1])
        else:
            edges.append((start, stop))
    return [(start * step_s, stop * step_s) for start, stop in edges]


def channels(acting: Sequence[Acting]) -> list[int]:
    """Return the places of the channels that any fault acts on."""
    return list(indices(name for entry in acting for name in names(entry)))


def compared(acting: Sequence[Acting], recorder: Recorder) -> list[dict[str, Any]]:
    """Return name, unit, and both courses of each channel that a fault acts on: `measured` by the
    car, `given` to the sensor, (rows,) each.
    """
    measured, given = recorder.group("measured"), recorder.group("channels")
    return [
        {
            "name": CHANNELS[i].name,
            "unit": CHANNELS[i].unit,
            "measured": measured[:, i],
            "given": given[:, i],
        }
        for i in channels(acting)
    ]


def idle(acting: Sequence[Acting], rows: int, step_s: float) -> list[str]:
    """Return a sentence for each fault that had no sample to act on in a run of so many rows."""
    end = (rows - 1) * step_s
    return [
        f"fault {entry.label} never acted: the run ended at {end:.2f} s"
        for entry in acting
        if not spans([entry], rows, step_s)
    ]


def _first(window: Window) -> int:
    return window.first


def _names(fault: PlainFault) -> Sequence[str]:
    if isinstance(fault, SwappedWheels):
        return [f"Car.v{wheel}" for wheel in fault.wheels]
    return fault.channels
