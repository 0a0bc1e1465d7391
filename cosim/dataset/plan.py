"""From a recipe to its runs: which scenario, seed, dampers and drawn values each has."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim.dataset.draw import Draws, drawn_from, fields_of
from cosim.dataset.recipe import MOST_RUNS, Dampers, Recipe, RecipeFile, Selection
from cosim.errors import InputError, Place, Problem
from cosim.scenario.overrides import Override, split_key
from cosim.scenario.source import Key
from cosim.scenario.surface import SurfaceName

_VALUES, _COMMAND = 0, 1  # what a run draws, each by random numbers of its own
COMMAND: Final = "command"  # the drawn name of a fixed damper command


@dataclass(frozen=True)
class PlannedRun:
    """One run: its scenario file, dampers and seed; `stem` names its file.

    `overrides` are laid over the scenario, each with the place in the recipe that asks for it;
    `drawn` are the values that were drawn, by name.
    """

    stem: str
    scenario: Path
    dampers: Dampers
    seed: int
    overrides: tuple[Override, ...] = field(default=(), compare=False)
    drawn: Mapping[str, Any] = field(default_factory=dict, compare=False)


@dataclass(frozen=True)
class _Chosen:
    """A run before it has a number in the recipe: selection, file, surface, dampers, which of
    `count`.
    """

    index: int
    file: Path
    surface: SurfaceName | None
    dampers: Dampers
    number: int


def plan(file: RecipeFile) -> list[PlannedRun]:
    """Return the runs in a fixed order; raises `InputError` for patterns that match nothing, runs
    of the same name, and too many of them.
    """
    problems: list[Problem] = []
    chosen: list[_Chosen] = []
    for index, selection in enumerate(file.recipe.runs):
        files = sorted(file.folder.glob(selection.scenarios))
        if not files:
            sentence = f"no scenario in '{file.folder}' matches '{selection.scenarios}'"
            place = file.source.locate(("runs", index, "scenarios"))
            problems.append(Problem(sentence, place))
        numbers = range(1, (selection.count or 1) + 1)
        product = itertools.product(
            files, selection.surfaces or (None,), selection.dampers, numbers
        )
        chosen += [_Chosen(index, *rest) for rest in product]
    problems += _doubled(file, chosen)
    if len(chosen) > MOST_RUNS:
        sentence = f"the recipe has {len(chosen)} runs; {MOST_RUNS} are the most"
        problems.append(Problem(sentence, file.source.locate(("runs",))))
    if problems:
        raise InputError(problems)
    return [_planned(file, one, i) for i, one in enumerate(chosen)]


def _doubled(file: RecipeFile, chosen: list[_Chosen]) -> Iterator[Problem]:
    """Yield a problem for each selection that has a run of the same name as one before."""
    seen: set[str] = set()
    told: set[int] = set()
    for one in chosen:
        stem = _stem(file.recipe.runs[one.index], one)
        if stem in seen and one.index not in told:
            told.add(one.index)
            sentence = f"the run '{stem}' is chosen more than once; give one of them a name"
            yield Problem(sentence, file.source.locate(("runs", one.index, "scenarios")))
        seen.add(stem)


def _stem(selection: Selection, one: _Chosen) -> str:
    """Return the file's name without ending, `<name>[_<surface>]_<dampers>[_<number>]`."""
    surface = one.surface or ""
    road = f"class_{surface.lower()}" if len(surface) == 1 else surface
    digits = len(str(selection.count or 1))
    number = f"{one.number:0{digits}d}" if selection.count else ""
    name = selection.name or one.file.stem
    return "_".join(part for part in (name, road, one.dampers, number) if part)


def _planned(file: RecipeFile, one: _Chosen, i: int) -> PlannedRun:
    """Return run `i` of the recipe with its values drawn."""
    selection, seed = file.recipe.runs[one.index], 1000 * file.recipe.seed + i
    random = np.random.default_rng([file.recipe.seed, i, _VALUES])
    draws, keys = _draws(file.recipe, one.index, random)
    drawn = drawn_from(draws, random)
    overrides = [_override("seed", seed, file, ("seed",))]
    if one.surface is not None:
        key = ("runs", one.index, "surfaces")
        overrides.append(_override("road.surface", one.surface, file, key))
    overrides += [
        _override(path, value, file, keys[name])
        for path, (name, value) in fields_of(draws, drawn).items()
    ]
    if one.dampers == "fixed":
        command = np.random.default_rng([file.recipe.seed, i, _COMMAND]).uniform()
        drawn[COMMAND] = round(float(command), 4)
    stem = _stem(selection, one)
    return PlannedRun(stem, one.file, one.dampers, seed, tuple(overrides), drawn)


def _override(path: str, value: Any, file: RecipeFile, key: Key) -> Override:
    """Return a value for the field at a dotted path, asked for by the recipe at `key`."""
    return Override(split_key(path), value, str(file.source.locate(key, at_key=True)))


def _draws(recipe: Recipe, index: int, random: np.random.Generator) -> tuple[Draws, dict[str, Key]]:
    """Return the draws of a run of a selection by name, and where each stands in the recipe."""
    selection = recipe.runs[index]
    parts: list[tuple[Key, Draws]] = [(("draw",), recipe.draw)]
    if selection.cases:
        case = int(random.integers(len(selection.cases)))
        parts.append((("runs", index, "cases", case), selection.cases[case]))
    parts.append((("runs", index, "draw"), selection.draw))
    draws: Draws = {}
    keys: dict[str, Key] = {}
    for key, part in parts:
        draws |= part
        keys |= {name: (*key, name) for name in part}
    return draws, keys


def check(runs: list[PlannedRun]) -> None:
    """Read the scenario of every run with its values; raises `InputError` with all that is wrong,
    the same mistake of several runs once.
    """
    from cosim.scenario.load import load_with

    found: dict[tuple[str, str], Problem] = {}
    for run in runs:
        try:
            load_with(run.scenario, run.overrides)
        except InputError as error:
            for problem in error.problems:
                place = problem.place or Place(str(run.scenario))
                alike = re.sub(r"-?\d[\d.]*", "#", problem.message)
                found.setdefault((str(place), alike), Problem(problem.message, place))
    if found:
        raise InputError(list(found.values()))
