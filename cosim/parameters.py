"""What start values a scenario may set in an FMU, and what is wrong with one."""

from __future__ import annotations

from collections.abc import Container

from cosim.errors import Problem
from cosim.fmi import KINDS, Description, Value
from cosim.scenario.source import Key
from cosim.wiring import Report


class Setting:
    """Judges an FMU's start values: those of its parameters, and of its inputs but for the ones
    that the loop writes (`written`).
    """

    def __init__(self, description: Description, written: Container[str], report: Report) -> None:
        self._description, self._written, self._report = description, written, report
        self.parameters = {
            name: v
            for name, v in description.variables.items()
            if v.causality in ("parameter", "input")
        }

    def problem(self, key: Key, name: str, value: Value) -> Problem | None:
        """Return what is wrong with a start value that stands at `key`, None if nothing is."""
        variable = self.parameters.get(name)
        if variable is None:
            sentence = f"'{self._description.path.name}' has no parameter '{name}'"
            return self._report(key, sentence, tuple(self.parameters), name)
        if name in self._written:
            sentence = f"'{name}' is written by the loop at every step; it is no parameter"
            return self._report(key, sentence)
        unfit = _unfit(variable, value, self._description.unit_of(name))
        return None if unfit is None else self._report(key, f"{name} {unfit}")


def _unfit(variable: object, value: Value, unit: str | None) -> str | None:
    """Say why a value does not fit a variable, or None."""
    declared = str(getattr(variable, "type"))  # noqa: B009 - FMPy's variables have no types for mypy
    if getattr(variable, "dimensions", None):
        return "is an array; only single values can be set"
    kind = KINDS.get(declared)
    if kind is None:
        return f"is of type {declared}; only real, whole, Boolean and text parameters can be set"
    wants = {"Boolean": (bool, "true or false"), "String": (str, "text")}.get(kind)
    if wants is not None:
        return None if isinstance(value, wants[0]) else f"= {_shown(value)} must be {wants[1]}"
    if isinstance(value, bool | str):
        return f"= {_shown(value)} must be a number"
    if kind == "Integer" and value != int(value):
        return f"= {value:g} must be a whole number"
    low, high = getattr(variable, "min", None), getattr(variable, "max", None)
    shown = f" {unit}" if unit and unit != "1" else ""
    if low is not None and value < float(low):
        return f"= {value:g}{shown} is below its least value {float(low):g}{shown}"
    if high is not None and value > float(high):
        return f"= {value:g}{shown} is above its greatest value {float(high):g}{shown}"
    return None


def _shown(value: Value) -> str:
    """Return a value as YAML writes it."""
    return str(value).lower() if isinstance(value, bool) else repr(value)
