"""All runs pooled, as a table for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cosim.tables import Table, number


def overview(evaluated: Mapping[str, Any]) -> Table:
    """Return all runs pooled: a row per condition and estimator."""
    from sensor.metrics import BANDS, MODES, pool

    columns = (
        "estimator", "condition", "RMSE [m/s]", "accuracy [%]", "on presumed target [%]",
        "right sign [%]", *(f"{part} [%]" for part in (*MODES, *BANDS)), "covered [%]",
    )  # fmt: skip
    rows = []
    for condition in evaluated["conditions"]:
        for estimator in evaluated["estimators"]:
            found = pool([run["figures"][condition][estimator] for run in evaluated["runs"]])
            parts = {**found["modes"], **found["bands"]}
            cells = [
                number(found["overall"]["rmse"]),
                number(found["overall"]["accuracy"], 1),
                number(found["projected"]["accuracy"], 1),
                number(found["overall"]["sign_agreement"], 1),
                *(number(parts[name]["accuracy"], 1) for name in (*MODES, *BANDS)),
                _covered(found["coverage"]),
            ]
            rows.append((estimator, condition, *cells))
    samples = sum(record["samples"] for record in evaluated["runs"])
    title = f"{len(evaluated['runs'])} runs pooled, {samples} samples; accuracy by mode and band"
    return Table(title, columns, tuple(rows))


def _covered(coverage: Mapping[str, float] | None) -> str:
    """Least and largest share of errors within the predicted 90 % band, over the wheels."""
    if coverage is None:
        return "-"
    return f"{min(coverage.values()):.1f} … {max(coverage.values()):.1f}"
