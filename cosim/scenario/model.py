"""The base of every part of a scenario."""

from __future__ import annotations

from typing import Any, Final

from pydantic import BaseModel, ConfigDict

NAME_PATTERN: Final = r"^[a-z][a-z0-9_]*$"


def with_unit(unit: str) -> dict[str, Any]:
    """Return what carries a field's unit into the JSON Schema."""
    return {"unit": unit}


class Model(BaseModel):
    """Base of every part of a scenario: frozen, no unknown fields, no silent conversions."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, allow_inf_nan=False, validate_default=False
    )
