"""A signal in a window of time, as limits and goldens name it."""

from __future__ import annotations

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from cosim.scenario.model import Model, with_unit


class Window(Model):
    """A window of time, from beginning to end of the run if nothing is given."""

    from_s: float | None = Field(
        default=None, ge=0, description="first time that counts", json_schema_extra=with_unit("s")
    )
    to_s: float | None = Field(
        default=None, ge=0, description="last time that counts", json_schema_extra=with_unit("s")
    )

    @model_validator(mode="after")
    def _in_order(self) -> Window:
        if self.from_s is not None and self.to_s is not None and self.from_s > self.to_s:
            raise PydanticCustomError(
                "window",
                "from_s ({begin} s) must not be after to_s ({end} s)",
                {"begin": self.from_s, "end": self.to_s},
            )
        return self
