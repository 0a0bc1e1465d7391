"""How often an estimate has the wrong sign although it is the best one of its bound.

The suspension velocity v is taken as normal with standard deviation s, and the best linear estimate
v' of it leaves an error of relative size r, uncorrelated with v'. So v' has the deviation c s and
the correlation c with v, c = sqrt(1 - r^2), and given v it is normal about c^2 v (Papoulis,
Probability, Random Variables and Stochastic Processes, jointly normal variables).
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from markdown_tables import percent, table
from scipy.integrate import quad
from scipy.stats import norm

from sensor.metrics.figures import SIGN_THRESHOLD

ROOT = Path(__file__).parents[2]
CONDITIONS = ("ideal", "production")
_FAR = 12.0  # standard deviations; nothing lies beyond


def wrong_percent(rms: float, accuracy: float) -> float:
    """Return the share [%] of wrong signs where |v| is above 20 mm/s, for v of this rms [m/s] and
    an estimate of this accuracy [%]: 100 (1 - r).
    """
    left = 1.0 - accuracy / 100.0
    kept = math.sqrt(1.0 - left * left)

    def wrong(velocity: float) -> float:
        """The density of a velocity, in deviations, times the share of its wrong estimates."""
        return float(norm.pdf(velocity) * norm.cdf(-kept * velocity / left))

    threshold = SIGN_THRESHOLD / rms
    share, _ = quad(wrong, threshold, _FAR, epsabs=1e-10)
    return 100.0 * share / float(norm.sf(threshold))


def bounds_table() -> str:
    """Return the table of the cases of docs/bounds.json, which `make bounds` computes."""
    cases = json.loads((ROOT / "docs" / "bounds.json").read_text("utf-8"))
    header = ["case", "rms, mm/s", *(f"{c}: {what}" for c in CONDITIONS
                                     for what in ("accuracy, %", "wrong, %"))]  # fmt: skip
    return table(header, _rows(cases))


def _rows(cases: Sequence[dict[str, object]]) -> Iterator[list[str]]:
    for case in cases:
        rms, accuracy = case["truth"], case["accuracy"]
        assert isinstance(rms, float)
        assert isinstance(accuracy, dict)
        row = [str(case["case"]), f"{1e3 * rms:.1f}"]
        for condition in CONDITIONS:
            bound = accuracy[condition]["kalman"]
            row += [percent(bound), f"{wrong_percent(rms, bound):.2f}"]
        yield row
