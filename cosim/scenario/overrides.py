"""`--set a.b=1`: values laid over the file before it is checked."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from typing import Any, Final

from cosim.scenario.source import Key, Source

# Below these the names are the user's own and contain dots; so many parts may follow them.
OPEN_MAPPINGS: Final[dict[Key, int]] = {("vehicle", "parameters"): 0, ("vehicle", "variables"): 1}


def split_key(text: str) -> Key:
    """Return the path that a dotted text means; `controllers.0.kind` counts list items from 0.

    Below `vehicle.parameters` all is one name: `vehicle.parameters.Body.Mass` has three parts.
    """
    parts: tuple[str, ...] = tuple(text.split("."))
    for above, below in OPEN_MAPPINGS.items():
        if parts[: len(above)] == above and len(parts) > len(above) + 1:
            end = len(parts) - below if len(parts) > len(above) + 1 + below else len(parts)
            name = ".".join(parts[len(above) : end])
            parts = (*parts[: len(above)], name, *parts[end:])
    return tuple(int(part) if part.isdecimal() else part for part in parts)


@dataclass(frozen=True)
class Override:
    """A value for the field at `key`, and the text that a message shall name it by."""

    key: Key
    value: Any
    label: str


def parse_override(text: str, label: str) -> Override | str:
    """Return what `key=value` means, or what is wrong with it."""
    dotted, equals, value_text = text.partition("=")
    key = split_key(dotted.strip())
    if not equals or "" in key:
        return "write KEY=VALUE, such as --set driver.style=normal"
    value, message = _parse(value_text)
    return Override(key, value, label) if message is None else message


def apply_override(data: dict[str, Any], source: Source, override: Override) -> str | None:
    """Lay one value over `data`; return what is wrong with it, or None."""
    message = _insert(data, override.key, deepcopy(override.value))
    if message is None:
        source.override(override.key, override.label)
    return message


def _parse(text: str) -> tuple[Any, str | None]:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe", pure=True).load(text), None
    except (YAMLError, ValueError):
        return None, f"the value '{text}' is not YAML 1.2"


def _insert(data: dict[str, Any], key: Key, value: Any) -> str | None:
    """Set `value` at `key`, making mappings on the way; return what stands in the way, or None."""
    here: Any = data
    for depth, part in enumerate(key):
        above = ".".join(str(name) for name in key[:depth]) or "the scenario"
        last = depth == len(key) - 1
        if isinstance(here, list):
            if not isinstance(part, int) or part >= len(here):
                return f"{above} has no item '{part}'; it has {len(here)}, counted from 0"
        elif isinstance(here, dict):
            part = str(part)
            if not last and here.get(part) is None:
                here[part] = {}
        else:
            return f"{above} is '{here}' and has no fields"
        if last:
            here[part] = value
        else:
            here = here[part]
    return None
