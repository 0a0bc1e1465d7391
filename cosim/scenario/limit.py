"""A limit of a scenario."""

from __future__ import annotations

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.scenario.surface import SurfaceName
from cosim.scenario.window import Window
from cosim.signal_statistics import Statistic


class Limit(Window):
    """A bound on one metric, or on one signal in a window; the run fails when it is crossed."""

    metric: str | None = Field(default=None, min_length=1, description="path in metrics.json")
    signal: str | None = Field(default=None, min_length=1, description="name of a recorded signal")
    statistic: Statistic = Field(
        default="each", description="what of the signal is bounded: each of its samples, or this"
    )
    min: float | None = Field(default=None, description="smallest value that passes")
    max: float | None = Field(default=None, description="largest value that passes")
    surface: SurfaceName | None = Field(
        default=None, description="only on this surface; on others the limit is left out"
    )

    @model_validator(mode="after")
    def _of_one_thing(self) -> Limit:
        if (self.metric is None) == (self.signal is None):
            raise PydanticCustomError("limited", "a limit needs either a metric or a signal")
        given = {"statistic": self.statistic != "each", "from_s": self.from_s, "to_s": self.to_s}
        of_signal = [name for name, value in given.items() if value not in (None, False)]
        if self.metric is not None and of_signal:
            raise PydanticCustomError(
                "of_signal",
                "{field} belongs to a limit on a signal, not on a metric",
                {"field": of_signal[0]},
            )
        return self

    @model_validator(mode="after")
    def _some_bound(self) -> Limit:
        if self.min is None and self.max is None:
            raise PydanticCustomError("no_bound", "a limit needs min, max or both")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise PydanticCustomError(
                "crossed",
                "min ({low}) must not be greater than max ({high})",
                {"low": self.min, "high": self.max},
            )
        return self
