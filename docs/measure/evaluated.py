"""What `cosim sensor evaluate` found: by row of the paper's Table 4, and by case."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from cases import Case

from sensor.metrics import pool
from sensor.paper import PaperRow

Record = Mapping[str, Any]

ROOT = Path(__file__).parents[2]
SURFACES = {"smooth": "smooth", "class_a": "ISO class A", "class_b": "ISO class B"}
NAMES = {
    "zero": "zero",
    "body_motion": "body motion",
    "fir_w19": "FIR 19",
    "fir_w64": "FIR 64",
    "fir_residual_w19": "FIR 19, residuals",
    "fir_residual_w64": "FIR 64, residuals",
    "kalman_imu": "Kalman, IMU",
    "kalman_wheels": "Kalman, wheels",
    "kalman_delay": "Kalman, delay",
    "kalman": "Kalman",
    "smoother": "smoother (offline)",
    "bilstm_w19": "paper's BiLSTM",
    "bilstm_residual_w19": "BiLSTM, residuals",
    "carried": "carried state",
}
"""What the pages call the estimators of the registry."""


class Evaluated:
    """The records of `cosim sensor evaluate`."""

    def __init__(self, content: Mapping[str, Any]) -> None:
        self.estimators: Sequence[str] = content["estimators"]
        self.conditions: Sequence[str] = content["conditions"]
        self.runs: Sequence[Mapping[str, Any]] = content["runs"]
        self.provenance: Mapping[str, str] = content["provenance"]
        self._scenarios = scenarios_of_the_paper()

    @classmethod
    def read(cls, file: Path) -> Evaluated:
        """Read the command's file."""
        return cls(json.loads(file.read_text(encoding="utf-8")))

    @property
    def commit(self) -> str:
        """The sources that the figures are from."""
        return self.provenance.get("commit", "unknown")[:12]

    def case(self, case: Case) -> list[Record]:
        """The runs of a case; raises ValueError if there is none."""
        found = [run for run in self.runs if fnmatchcase(run["name"], case.pattern)]
        if not found:
            raise ValueError(f"no run of the evaluation is called {case.pattern} ({case.label})")
        return found

    def pooled(self, runs: Sequence[Record], condition: str, estimator: str) -> Record:
        """One estimator's figures, pooled over runs."""
        return pool([run["figures"][condition][estimator] for run in runs])

    def runs_of(self, row: PaperRow, surface: str) -> list[Record]:
        """The run of a row of the paper's Table 4; raises ValueError if it is not there."""
        name = f"{self._scenarios[row.scenario]}_{surface}_passive"
        return self.case(Case(row.scenario, name))

    def paper_row(self, row: PaperRow, surface: str, condition: str, estimator: str) -> Record:
        """One estimator's figures on a row of the paper's Table 4."""
        return self.pooled(self.runs_of(row, surface), condition, estimator)


def scenarios_of_the_paper() -> dict[str, str]:
    """The scenario that stands for each row of the paper's Table 4."""
    from ruamel.yaml import YAML

    files = sorted((ROOT / "scenarios" / "paper").glob("*.yaml"))
    read = YAML(typ="safe").load
    return {read(file.read_text(encoding="utf-8"))["paper_row"]: file.stem for file in files}
