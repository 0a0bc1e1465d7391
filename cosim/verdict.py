"""The verdict on one run by one limit or golden."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from cosim.metrics import unit_of


@dataclass(frozen=True)
class Verdict:
    """One limit in one run. `value` is None where the run has no such figure, which fails, and
    `remark` says why if there is more to say; `surface` is the one that the limit is made for,
    `at_s` when the value occurred. `metric` is the path of a figure, whose name tells its unit, or
    what was made of a signal, with its `unit`.
    """

    run: str
    metric: str
    value: float | None
    min: float | None
    max: float | None
    passed: bool
    surface: str | None = None
    unit: str | None = None
    at_s: float | None = None
    remark: str = ""

    @property
    def required(self) -> str:
        """What was asked for, in words."""
        low = f"at least {self._shown(self.min)}" if self.min is not None else ""
        high = f"at most {self._shown(self.max)}" if self.max is not None else ""
        on = f" (surface {self.surface})" if self.surface is not None else ""
        return (" and ".join(words for words in (low, high) if words) or "to be available") + on

    @property
    def measured(self) -> str:
        """What was found, in words."""
        remark = f" ({self.remark})" if self.remark else ""
        if self.value is None:
            return f"not available{remark}"
        at = f" at {self.at_s:.6g} s" if self.at_s is not None else ""
        return f"{self._shown(self.value)}{at}{remark}"

    def __str__(self) -> str:
        outcome = "passed" if self.passed else "FAILED"
        return f"{outcome}: {self.run}: {self.metric} is {self.measured}, required {self.required}"

    def _shown(self, value: float) -> str:
        unit = unit_of(self.metric) if self.unit is None else self.unit
        return f"{value:.4g} {unit}".rstrip()

    def as_dict(self) -> dict[str, Any]:
        """Return the verdict as it stands in metrics.json."""
        return asdict(self)
