"""Parts of a run around a fault, and how its times are shown."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fault_rig import settings

from cosim.faults.figures import fault_figures, parts, windows
from cosim.faults.shown import fault_table, idle, spans, times
from cosim.recorder import Recorder, Signal
from cosim.scenario.osp_scenario import Acting, acting
from cosim.scenario.source import Source

ROWS = 2000


def entries(*faults: dict[str, Any]) -> tuple[Acting, ...]:
    return acting(settings(*faults), Source())[0]


def gain(start: float, end: float | None) -> dict[str, Any]:
    return {"kind": "gain", "channels": "imu", "factor": 2.0, "start_s": start, "end_s": end}


def of_two(*faults: dict[str, Any]) -> Acting:
    """Several faults as one entry, as those of a file of events are."""
    return Acting("events", tuple(f for entry in entries(*faults) for f in entry.faults))


@pytest.mark.parametrize(
    ("start", "end", "before", "during", "after"),
    [
        (7, 9, (200, 700), (700, 900), (900, 1400)),
        (2, 9, (0, 200), (200, 900), (900, 1400)),
        (0, 18, (0, 0), (0, 1800), (1800, 2000)),
        (7, None, (200, 700), (700, 2000), (2000, 2000)),
        (30, 40, (2000, 2000), (2000, 2000), (2000, 2000)),
    ],
)
def test_before_and_after_are_five_seconds_each(
    start: float, end: float | None, before: Any, during: Any, after: Any
) -> None:
    (entry,) = entries(gain(start, end))
    found = parts(windows(entry), ROWS)
    for part, (first, stop) in zip(
        ("before", "during", "after"), (before, during, after), strict=True
    ):
        np.testing.assert_array_equal(np.flatnonzero(found[part]), np.arange(first, stop))


def test_events_are_one_fault_with_several_windows() -> None:
    found = parts(windows(of_two(gain(12, 13), gain(8, 9))), ROWS)
    during = [*range(800, 900), *range(1200, 1300)]
    np.testing.assert_array_equal(np.flatnonzero(found["during"]), during)
    np.testing.assert_array_equal(np.flatnonzero(found["before"]), np.arange(300, 800))
    np.testing.assert_array_equal(np.flatnonzero(found["after"]), np.arange(1300, 1800))
    assert times(of_two(gain(12, 13), gain(8, 9))) == "8 to 13"


def test_shaded_spans_are_joined_and_end_with_the_run() -> None:
    faults = entries(gain(3, 5), gain(1, 2), gain(4, 6), gain(19, None), gain(25, 30))
    assert spans(faults, ROWS, 0.01) == [(1.0, 2.0), (3.0, 6.0), (19.0, 20.0)]
    assert idle(faults, ROWS, 0.01) == ["fault gain_5 never acted: the run ended at 19.99 s"]
    assert [times(entry) for entry in faults][3:] == ["19 to end", "25 to 30"]


def test_coverage_counts_errors_within_the_band() -> None:
    """A deviation of 1 and errors of 1, 1.6, 1.7 and 3 at the four wheels: half lie within."""
    groups = {"estimate": 4, "deviation": 4, "valid": 1, "truth": 4}
    record = Recorder(
        [(n, [Signal(f"{n}{i}", "") for i in range(k)]) for n, k in groups.items()], 600
    )
    for k in range(600):
        record.append(k, [1.0, 1.6, 1.7, 3.0], np.ones(4), float(k >= 150), np.zeros(4))
    (entry,) = entries(gain(1, 2))
    found = fault_figures([entry], record)["gain"]["during"]
    assert found["valid_percent"] == 50.0
    assert found["covered_percent"] == 50.0
    assert found["rmse_m_s"] == pytest.approx(np.sqrt(np.mean(np.square([1.0, 1.6, 1.7, 3.0]))))
    table = fault_table([entry], {"faults": {"gain": {"during": found}}}, "passive")
    assert table is not None
    assert table.rows == (("gain", "imu", "1 to 2", "-", "1.9653", "-", "50.0", "50.0"),)


def test_files_with_events_stand_beside_the_scenario(tmp_path: Path) -> None:
    (tmp_path / "e.yaml").write_text(
        "events:\n- {time: 1, model: car, variable: Car.az, action: bias, value: 1}\nend: 2\n"
    )
    given = settings({"kind": "osp_scenario", "file": "e.yaml"})
    found, problems = acting(given, Source(path=tmp_path / "scenario.yaml"))
    assert not problems
    assert [(f.start_s, f.end_s) for f in found[0].faults] == [(1.0, 2.0)]
