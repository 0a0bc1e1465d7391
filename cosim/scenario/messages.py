"""pydantic's findings as sentences with a place, a unit and the nearest valid choice."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from pydantic import ValidationError

from cosim.errors import Problem, did_you_mean
from cosim.scenario.source import Key, Source

BOUNDS: Final = {
    "greater_than": ("greater than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}
EXPECTED: Final = {
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "finite_number": "a finite number",
    "model_type": "a mapping of fields",
    "model_attributes_type": "a mapping of fields",
    "dict_type": "a mapping",
    "tuple_type": "a list",
    "string_too_short": "text that is not empty",
    "string_pattern_mismatch": "a name of small letters, digits and underscores",
}


def problems_of(
    error: ValidationError, data: Any, source: Source, schema: dict[str, Any]
) -> Iterator[Problem]:
    """Yield each of pydantic's findings as a problem at its place in the file; `schema` is the JSON
    Schema of the whole file, whose title says what it is.
    """
    for finding in error.errors(include_url=False):
        if finding["type"] == "too_short" and finding["input"]:
            continue  # not empty in the file: its items are wrong, and are reported themselves
        location = finding["loc"]
        key = _key(location, data, finding["type"])
        unknown = finding["type"] == "extra_forbidden"
        place = source.locate(key, at_key=unknown)
        yield Problem(_sentence(dict(finding), key, schema), place)


def _key(location: tuple[str | int, ...], data: Any, kind: str) -> Key:
    """Return the path in the file; pydantic's own also names the member of a union."""
    key: list[str | int] = []
    for index, part in enumerate(location):
        in_mapping = isinstance(data, dict) and part in data
        in_list = isinstance(data, list) and isinstance(part, int) and part < len(data)
        if in_mapping or in_list:
            key.append(part)
            data = data[part]
        elif kind == "missing" and index == len(location) - 1:
            key.append(part)
    return tuple(key)


def _sentence(finding: dict[str, Any], key: Key, schema: dict[str, Any]) -> str:
    kind, context, value = finding["type"], finding.get("ctx", {}), finding["input"]
    name, above, whole = _dotted(key), _dotted(key[:-1]), schema["title"].lower()
    part = _descend(schema, finding["loc"])
    unit = _unit(part)
    if kind == "extra_forbidden":
        return _unknown(str(key[-1]), above, finding["loc"], schema)
    if kind == "missing":
        return f"{above or f'the {whole}'} has no {key[-1]}, which it needs"
    if kind == "literal_error":
        choices = _choices(part)
        hint = did_you_mean(str(value), choices)
        return f"{name} must be {_one_of(choices)}, not {_shown(value)}{hint}"
    tag = kind in ("union_tag_invalid", "union_tag_not_found")
    if tag or (kind == "model_attributes_type" and _kinds(part)):
        return _wrong_kind(name, value, part)
    if kind in BOUNDS:
        words, bound = BOUNDS[kind]
        return f"{name} must be {words} {context[bound]:g}{unit}, not {_shown(value)}{unit}"
    if kind in EXPECTED:
        in_unit = f" in{unit}" if unit else ""
        return f"{name} must be {EXPECTED[kind]}{in_unit}, not {_shown(value)}"
    if kind == "too_short":
        return f"{name} must not be empty"
    message = str(finding["msg"])
    if message.startswith("must "):
        return f"{name} {message}, not {_shown(value)}{context.get('hint', '')}"
    return f"{name or f'the {whole}'}: {message}"


def _unknown(name: str, above: str, location: Key, schema: dict[str, Any]) -> str:
    fields = list(_descend(schema, location[:-1]).get("properties", {}))
    sentence = f"'{name}' is not a field of {above or 'a ' + schema['title'].lower()}"
    if above and name in schema["properties"]:
        return f"{sentence}; it belongs to the top level"
    for section, entry in schema["properties"].items():
        if name in _resolve(entry, schema).get("properties", {}):
            return f"{sentence}; it belongs to {section}"
    hint = did_you_mean(name, fields)
    return sentence + (hint or f", which has {', '.join(fields)}")


def _wrong_kind(name: str, value: Any, schema: dict[str, Any]) -> str:
    kinds = list(_kinds(schema))
    if not isinstance(value, dict):
        return f"{name} must be a mapping with kind: {_one_of(kinds)}, not {_shown(value)}"
    if "kind" not in value:
        return f"{name} has no kind, which is {_one_of(kinds)}"
    kind = str(value["kind"])
    return f"{name}.kind must be {_one_of(kinds)}, not '{kind}'{did_you_mean(kind, kinds)}"


def _descend(schema: dict[str, Any], location: tuple[str | int, ...]) -> dict[str, Any]:
    """Return the part of the JSON Schema that pydantic's location stands for."""
    here = _resolve(schema, schema)
    for part in location:
        mapping = _kinds(here)
        if part in here.get("properties", {}):
            here = here["properties"][part]
        elif part in mapping:
            here = {"$ref": mapping[part]}
        elif isinstance(part, int) and "items" in here:
            here = here["items"]
        elif isinstance(here.get("additionalProperties"), dict):
            here = here["additionalProperties"]
        here = _resolve(here, schema)
    return here


def _kinds(here: dict[str, Any]) -> dict[str, str]:
    """Return where each kind is described, also below a field that may be a single word instead."""
    found = [member.get("discriminator", {}) for member in (here, *here.get("anyOf", []))]
    return next((one["mapping"] for one in found if "mapping" in one), {})


def _resolve(here: dict[str, Any], schema: dict[str, Any]) -> dict[str, Any]:
    """Return what a reference stands for, and what an optional field is where it is given."""
    while True:
        given = [member for member in here.get("anyOf", ()) if member != {"type": "null"}]
        if "$ref" in here:
            here = schema["$defs"][here["$ref"].rsplit("/", 1)[-1]]
        elif len(given) == 1:
            here = {name: part for name, part in here.items() if name != "anyOf"} | given[0]
        else:
            return here


def _choices(schema: dict[str, Any]) -> list[str]:
    members = [schema, *schema.get("anyOf", [])]
    found = [str(choice) for member in members for choice in member.get("enum", [])]
    return found + [str(member["const"]) for member in members if "const" in member]


def _unit(schema: dict[str, Any]) -> str:
    return f" {schema['unit']}" if "unit" in schema else ""


def _dotted(key: Key) -> str:
    return ".".join(str(part) for part in key)


def _one_of(choices: list[str]) -> str:
    return choices[0] if len(choices) == 1 else f"{', '.join(choices[:-1])} or {choices[-1]}"


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if value is None:
        return "nothing"
    if isinstance(value, dict | list):
        return "a mapping" if isinstance(value, dict) else "a list"
    return f"{value:g}" if isinstance(value, float) else repr(value)
