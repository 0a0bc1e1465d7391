"""A scenario's text: its YAML 1.2 tree, where each part stands, and the overrides laid over it.

The tree is composed first and constructed afterwards, so that every doubled key is reported with
both places (YAML 1.2.2, section 3.2.1.1: keys are unique), and each value keeps its exact span.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from cosim.errors import InputError, Place, Problem, nearest

Key = tuple[str | int, ...]


@dataclass
class Source:
    """Text of a scenario file with the place of every key and value.

    `keys` and `values` map a path from the top to (line, column, length), all counted from 1.
    """

    path: Path | None = None
    lines: list[str] = field(default_factory=list)
    keys: dict[Key, tuple[int, int, int]] = field(default_factory=dict)
    values: dict[Key, tuple[int, int, int]] = field(default_factory=dict)
    overrides: dict[Key, str] = field(default_factory=dict)

    @property
    def folder(self) -> Path:
        """Folder that relative paths start from."""
        return self.path.parent if self.path is not None else Path()

    def locate(self, key: Key, at_key: bool = False) -> Place | None:
        """Return the place of a value (or its key), else that of the nearest part above."""
        for size in range(len(key), -1, -1):
            part = key[:size]
            if part in self.overrides:
                return Place(self.overrides[part])
            # The part asked for is underlined as a value, a part above it by its name.
            exact = size == len(key) and not at_key
            for spans in (self.values, self.keys) if exact else (self.keys, self.values):
                if part in spans:
                    return self.place(*spans[part])
            made = [text for name, text in self.overrides.items() if part and name[:size] == part]
            if made:
                return Place(made[0])
        return None

    def override(self, key: Key, text: str) -> None:
        """Note that `key` now comes from an option, and forget where it stood in the file."""
        for spans in (self.keys, self.values):
            for old in [old for old in spans if old[: len(key)] == key]:
                del spans[old]
        self.overrides[key] = text

    def place(self, line: int, column: int, length: int) -> Place:
        """Return the place at a line and column of the file, both counted from 1."""
        source = self.lines[line - 1] if line <= len(self.lines) else ""
        return Place(str(self.path), line, column, source, length)


def read(
    path: Path, needs: str = "a scenario needs at least name and road", what: str = "scenario"
) -> tuple[dict[str, Any], Source, list[Problem]]:
    """Read a YAML file into plain values, its source and the problems that do not stop the reading.

    `needs` ends the message about a file without content, `what` is what the file should be.

    Raises `InputError` when there is no file, no text or no mapping to go on with.
    """
    data, source, problems = _read(path, _text(path, what), needs)
    # What was read is kept, and overrides are laid over copies of it.
    fresh = replace(source, keys=dict(source.keys), values=dict(source.values), overrides={})
    return deepcopy(data), fresh, list(problems)


@lru_cache(maxsize=64)
def _read(path: Path, text: str, needs: str) -> tuple[dict[str, Any], Source, list[Problem]]:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    source = Source(path=path, lines=text.splitlines())
    problems: list[Problem] = []
    yaml = YAML(typ="safe", pure=True)
    try:
        root = yaml.compose(io.StringIO(text))
        if root is None:
            raise InputError(Problem(f"{path} is empty; {needs}"))
        problems += _walk(root, (), source, ())
        data = yaml.constructor.construct_document(root)
    except MarkedYAMLError as error:
        raise InputError([*problems, _syntax_problem(error, source)]) from None
    except (YAMLError, ValueError) as error:
        raise InputError(f"{path}: this is not YAML 1.2: {_one_line(error)}") from None
    if not isinstance(data, dict):
        raise InputError(Problem("a mapping of fields to values belongs here", source.locate(())))
    return data, source, problems


def _text(path: Path, what: str) -> str:
    if not path.exists():
        near = path.parent.iterdir() if path.parent.is_dir() else ()
        beside = [p.name for p in near if p.is_dir() or p.suffix in (".yaml", ".yml")]
        match = nearest(path.name, beside)
        hint = f"; did you mean '{path.parent / match}'?" if match else ""
        raise InputError(f"{path}: no such {what} file{hint}")
    if path.is_dir():
        raise InputError(f"{path} is a folder, not a {what} file")
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start} is not UTF-8 text") from None
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None


def _walk(node: Any, key: Key, source: Source, above: tuple[int, ...]) -> Iterator[Problem]:
    """Note the span of every part below `node`; take out doubled keys and report them."""
    source.values[key] = _span(node)
    if id(node) in above:
        yield Problem("an alias must not stand inside its own anchor", source.locate(key))
        node.value = []
    if node.id == "sequence":
        for index, item in enumerate(node.value):
            yield from _walk(item, (*key, index), source, (*above, id(node)))
    elif node.id == "mapping":
        first: dict[str, Any] = {}
        kept = []
        for name, value in node.value:
            part = (*key, str(name.value))
            if name.id == "scalar" and name.value in first and name.value != "<<":
                line = first[name.value].start_mark.line + 1
                place = source.place(*_span(name))
                yield Problem(f"'{name.value}' is already given in line {line}", place)
                continue
            first[str(name.value)] = name
            kept.append((name, value))
            source.keys[part] = _span(name)
            yield from _walk(value, part, source, (*above, id(node)))
        node.value = kept


def _span(node: Any) -> tuple[int, int, int]:
    start, end = node.start_mark, node.end_mark
    same_line = end.line == start.line
    length = max(end.column - start.column, 1) if same_line else 10_000
    return start.line + 1, start.column + 1, length


def _syntax_problem(error: Any, source: Source) -> Problem:
    mark = error.problem_mark or error.context_mark
    words = [error.context, error.problem] if error.context else [error.problem]
    message = "this is not YAML 1.2: " + _one_line(", ".join(str(word) for word in words if word))
    return Problem(message, source.place(mark.line + 1, mark.column + 1, 1) if mark else None)


def _one_line(text: object) -> str:
    return " ".join(str(text).split())
