"""The paper's own figures: Table 3 (network search) and Table 4 (every scenario), as printed, and a
loader that reads them.

Two misprints are put right in the loader, never in the files:
- "Offensive driver" stands where the text describes defensive, normal and aggressive drivers, and
  its figures are the mildest.
- "Sine with Dwell 60 deg at 80 km/h" is printed twice; the second stands at the end of the 80 deg
  rows and is one.
"""

import csv
from dataclasses import dataclass, replace
from pathlib import Path

_HERE = Path(__file__).parent
_TWICE = "Sine with Dwell 60 deg at 80 km/h"

PRINTED_MEAN_ACCURACY = 91.2
"""Mean accuracy [%] over all 29 rows as the paper prints it, training rows included."""


@dataclass(frozen=True)
class PaperRow:
    """A row of Table 4: RMSE [m/s] per wheel (FL FR RL RR) and overall, accuracy [%], split
    training/validation/testing.
    """

    scenario: str
    split: str
    rmse: tuple[float, float, float, float]
    rmse_overall: float
    accuracy: float

    @property
    def truth_rms(self) -> float:
        """Rms of the paper's reference [m/s], from equations 1 and 2: RMSE / (1 - accuracy/100)."""
        return self.rmse_overall / (1.0 - self.accuracy / 100.0)


@dataclass(frozen=True)
class SearchRow:
    """A row of Table 3: the best network of each window length [samples], its validation RMSE [m/s]
    and duration [s].
    """

    window: int
    units: int
    hidden: int
    rmse: float
    relative_error_percent: float
    relative_duration_percent: float
    duration_s: float


def paper_rows() -> tuple[PaperRow, ...]:
    """Return the 29 rows of Table 4 in the printed order, misprints put right."""
    rows: list[PaperRow] = []
    for line in _read("table4.csv"):
        row = PaperRow(
            scenario=line["scenario"].replace("Offensive", "Defensive"),
            split=line["split"],
            rmse=(
                float(line["rmse_fl"]),
                float(line["rmse_fr"]),
                float(line["rmse_rl"]),
                float(line["rmse_rr"]),
            ),
            rmse_overall=float(line["rmse_overall"]),
            accuracy=float(line["accuracy_percent"]),
        )
        if row.scenario == _TWICE and any(earlier.scenario == _TWICE for earlier in rows):
            row = replace(row, scenario=_TWICE.replace("60 deg", "80 deg"))
        rows.append(row)
    return tuple(rows)


def search_rows() -> tuple[SearchRow, ...]:
    """Return the nine rows of Table 3."""
    return tuple(
        SearchRow(
            window=int(line["window"]),
            units=int(line["bilstm_units"]),
            hidden=int(line["fc_units"]),
            rmse=float(line["rmse"]),
            relative_error_percent=float(line["relative_error_percent"]),
            relative_duration_percent=float(line["relative_duration_percent"]),
            duration_s=float(line["duration_s"]),
        )
        for line in _read("table3.csv")
    )


def _read(name: str) -> list[dict[str, str]]:
    with (_HERE / name).open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
