"""Values that a recipe leaves to chance, and how one of them is drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from cosim.scenario.model import Model

DIGITS: Final = 6  # of a drawn number: what a file's metadata shows is what was driven

_Pair = Annotated[tuple[float, float], Field(strict=False)]


WAYS: Final = ("uniform", "log_uniform", "whole", "one_of")


def _kind(item: object) -> str:
    drawn = isinstance(item, Draw) or (isinstance(item, dict) and not item.keys().isdisjoint(WAYS))
    return "draw" if drawn else "value"


_Item = Annotated[
    Annotated["Draw", Tag("draw")] | Annotated[Any, Tag("value")], Discriminator(_kind)
]


class Draw(Model):
    """A value drawn anew for each run, in one of four ways.

    With `times` it is a factor: each field named there becomes the factor times its number, and the
    draw itself only has a name.
    """

    uniform: _Pair | None = Field(default=None, description="between two numbers")
    log_uniform: _Pair | None = Field(
        default=None, description="between two numbers, each ratio as likely"
    )
    whole: Annotated[tuple[int, int], Field(strict=False)] | None = Field(
        default=None, description="a whole number from the first to the last"
    )
    one_of: Annotated[tuple[_Item, ...], Field(strict=False, min_length=1)] | None = Field(
        default=None, description="any of these values or draws, each as likely"
    )
    times: dict[str, float] = Field(
        default_factory=dict, description="fields that become the drawn factor times a number"
    )

    @model_validator(mode="after")
    def _one_way(self) -> Draw:
        ways = [way for way in WAYS if getattr(self, way) is not None]
        if len(ways) != 1:
            raise PydanticCustomError("ways", f"give one of {', '.join(WAYS)}")
        for way in ("uniform", "log_uniform", "whole"):
            ends = getattr(self, way)
            if ends is not None and not ends[0] < ends[1]:
                sentence = f"{way} must go up, not from {ends[0]:g} to {ends[1]:g}"
                raise PydanticCustomError("down", sentence)
        if self.log_uniform is not None and self.log_uniform[0] <= 0.0:
            raise PydanticCustomError("zero", "log_uniform needs numbers greater than 0")
        if self.times and not self.numeric:
            raise PydanticCustomError("factor", "times needs numbers to draw a factor from")
        return self

    @property
    def numeric(self) -> bool:
        """Whether only numbers can be drawn."""
        items = self.one_of or ()
        return all(i.numeric if isinstance(i, Draw) else _is_number(i) for i in items)

    def of(self, random: np.random.Generator) -> Any:
        """Return a value."""
        if self.one_of is not None:
            item = self.one_of[int(random.integers(len(self.one_of)))]
            return item.of(random) if isinstance(item, Draw) else item
        if self.whole is not None:
            return int(random.integers(self.whole[0], self.whole[1], endpoint=True))
        if self.log_uniform is not None:
            low, high = self.log_uniform
            return _rounded(math.exp(random.uniform(math.log(low), math.log(high))))
        assert self.uniform is not None  # of four ways there is one
        return _rounded(random.uniform(*self.uniform))


def _spelt_out(value: object) -> object:
    """Return the mapping that a list of choices or a single value stands for."""
    if isinstance(value, list | tuple):
        return {"one_of": tuple(value)}
    return value if isinstance(value, dict | Draw) else {"one_of": (value,)}


Drawn = Annotated[Draw, BeforeValidator(_spelt_out, json_schema_input_type=Draw)]
Draws = dict[str, Drawn]


def drawn_from(draws: Mapping[str, Draw], random: np.random.Generator) -> dict[str, Any]:
    """Return a value by name for each draw, in their order."""
    return {name: draw.of(random) for name, draw in draws.items()}


def fields_of(draws: Mapping[str, Draw], values: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
    """Return the fields of the scenario that drawn values set: by the field's dotted path the name
    of the draw and the value.
    """
    fields: dict[str, tuple[str, Any]] = {}
    for name, draw in draws.items():
        if draw.times:
            for path, share in draw.times.items():
                fields[path] = name, _rounded(share * values[name])
        else:
            fields[name] = name, values[name]
    return fields


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
