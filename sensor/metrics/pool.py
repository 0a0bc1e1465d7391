"""Figures of several runs as of one: mean squares are added, accuracies never averaged."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sensor.metrics.match import Match

Record = Mapping[str, Any]


def pool(records: Sequence[Record]) -> dict[str, Any]:
    """Pool the records of one estimator (`sensor.evaluation.figures`) over several runs.

    Every run counts by its samples. Returns the same tree, without the band of errors, whose
    percentiles no pooling can give.
    """
    samples = [record["samples"] for record in records]
    pooled: dict[str, Any] = {"samples": sum(samples)}
    for group in ("wheels", "modes", "bands"):
        pooled[group] = {
            name: _match([record[group][name] for record in records], samples)
            for name in records[0][group]
        }
    overall = [record["overall"] for record in records]
    pooled["overall"] = _match(overall, samples) | _signs(overall)
    pooled["overall"]["max_abs_error"] = max(part["max_abs_error"] for part in overall)
    pooled["projected"] = _match([record["projected"] for record in records], samples)
    pooled["coverage"] = _coverage([record["coverage"] for record in records], samples)
    return pooled


def _match(parts: Sequence[Record], samples: Sequence[int]) -> dict[str, Any]:
    squares = [
        np.average(np.square([part[name] for part in parts]), weights=samples)
        for name in ("rmse", "truth_rms")
    ]
    return Match(*map(float, np.sqrt(squares))).to_dict()


def _signs(parts: Sequence[Record]) -> dict[str, Any]:
    moving = sum(part["moving_samples"] for part in parts)
    right = sum(part["moving_samples"] * (part["sign_agreement"] or 0.0) for part in parts)
    return {"sign_agreement": right / moving if moving else None, "moving_samples": moving}


def _coverage(parts: Sequence[Record | None], samples: Sequence[int]) -> dict[str, float] | None:
    offered = [part for part in parts if part is not None]
    if len(offered) < len(parts):
        return None
    return {
        wheel: float(np.average([part[wheel] for part in offered], weights=samples))
        for wheel in offered[0]
    }
