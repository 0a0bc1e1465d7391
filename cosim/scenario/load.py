"""Reading a scenario: file, overrides, validation and cross-checks, with every problem at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from cosim.errors import InputError, Place, Problem, did_you_mean
from cosim.limits import check_metric
from cosim.scenario.combinations import combination_problems
from cosim.scenario.controllers import label_of
from cosim.scenario.faults import numbered
from cosim.scenario.messages import problems_of
from cosim.scenario.osp_scenario import acting
from cosim.scenario.overrides import Override, apply_override, parse_override
from cosim.scenario.schema import Scenario, json_schema
from cosim.scenario.signals import raw_signal_problems, signal_problems
from cosim.scenario.source import Key, Source, read
from cosim.scenario.variants import combine
from sensor.paper import paper_rows

_NETWORK: Final = (".onnx", "an ONNX network")
_SENSOR_FMU: Final = (".fmu", "a sensor FMU")
FileField = tuple[Key, str | None, str, str]
# Fields that name a file, the word that needs none, and the ending that the file must have.
FILE_FIELDS: Final[tuple[FileField, ...]] = (
    (("road", "file"), None, ".crg", "an OpenCRG road"),
    (("vehicle", "fmu"), "builtin", ".fmu", "an FMU"),
    (("sensor", "network"), None, *_NETWORK),
    (("sensor", "fmu"), None, *_SENSOR_FMU),
)
CONTROLLER_FILE_FIELDS: Final[tuple[FileField, ...]] = (
    (("network",), None, *_NETWORK),
    (("fmu",), None, *_SENSOR_FMU),
    (("file",), None, ".fmu", "a controller FMU"),
)


def load(path: str | Path, overrides: Sequence[str] = ()) -> Scenario:
    """Return the scenario in `path` with overrides such as `driver.style=normal` laid over it.

    An override is applied before anything is checked. Raises `InputError` with every problem found.
    """
    return load_labelled(path, [(text, f"--set {text}") for text in overrides])


def load_labelled(path: str | Path, overrides: Sequence[tuple[str, str]]) -> Scenario:
    """Like `load`, each override with the text that a message shall name it by."""
    parsed = [(parse_override(text, label), label) for text, label in overrides]
    wrong = [Problem(one, Place(label)) for one, label in parsed if isinstance(one, str)]
    return load_with(path, [one for one, _ in parsed if isinstance(one, Override)], wrong)


def load_with(
    path: str | Path, overrides: Sequence[Override], wrong: Sequence[Problem] = ()
) -> Scenario:
    """Like `load`, with overrides that are values already; `wrong` is what was wrong before."""
    data, source, problems = read(Path(path))
    problems += wrong
    for override in overrides:
        problem = apply_override(data, source, override)
        if problem is not None:
            problems.append(Problem(problem, Place(override.label)))
    problems += _file_problems(data, source) + _name_problems(data, source)
    try:
        scenario = Scenario.model_validate(data)
    except ValidationError as error:
        problems += problems_of(error, data, source, json_schema())
    else:
        vehicle = scenario.vehicle
        scenario._source = source
        scenario._variants, found = combine(vehicle.variants, vehicle.parameters, source)
        problems += found
        problems += combination_problems(scenario)
        problems += acting(scenario.faults, source)[1]
        problems += () if problems else signal_problems(scenario)
    if problems:
        raise InputError(sorted(problems, key=_order))
    return scenario


def _order(problem: Problem) -> tuple[int, int]:
    """Sort by line and column, with problems of the command line last."""
    if problem.place is None or not problem.place.line:
        return (2**31, 0)
    return (problem.place.line, problem.place.column)


def _value(data: Any, key: Key) -> Any:
    for part in key:
        in_list = isinstance(data, list) and isinstance(part, int) and part < len(data)
        if not in_list and not (isinstance(data, dict) and part in data):
            return None
        data = data[part]
    return data


def _file_fields(data: dict[str, Any]) -> Iterator[FileField]:
    """Yield the fields that may name a file, those of each controller too."""
    yield from FILE_FIELDS
    controllers = data.get("controllers")
    for i in range(len(controllers) if isinstance(controllers, list) else 0):
        for key, word, ending, what in CONTROLLER_FILE_FIELDS:
            yield ("controllers", i, *key), word, ending, what


def _file_problems(data: dict[str, Any], source: Source) -> list[Problem]:
    """Check on the raw values, so that a wrong field elsewhere does not hide a missing file."""
    problems = []
    for key, word, ending, what in _file_fields(data):
        value = _value(data, key)
        if not isinstance(value, str) or not value or value == word:
            continue
        file = source.folder / value
        place = source.locate(key)
        name = ".".join(str(part) for part in key)
        if file.suffix.lower() != ending:
            instead = f"'{word}' or " if word else ""
            message = f"{name} must be {instead}{what} ({ending}), not '{value}'"
            problems.append(Problem(message + did_you_mean(value, [word] if word else []), place))
        elif not file.is_file():
            beside = file.parent.glob(f"*{ending}") if file.parent.is_dir() else ()
            hint = did_you_mean(file.name, [other.name for other in beside])
            problems.append(Problem(f"{name}: there is no file '{file}'{hint}", place))
    return problems


def _name_problems(data: dict[str, Any], source: Source) -> list[Problem]:
    """Check the names that are known before the run: metrics, signals and the paper's rows."""
    problems = []
    limits, labels, kind = data.get("limits"), _labels(data), _value(data, ("manoeuvre", "kind"))
    faults = _fault_labels(data)
    for index, limit in enumerate(limits if isinstance(limits, list) else ()):
        metric = limit.get("metric") if isinstance(limit, dict) else None
        message = check_metric(metric, labels, kind, faults) if isinstance(metric, str) else None
        if message:
            problems.append(Problem(message, source.locate(("limits", index, "metric"))))
    problems += raw_signal_problems(data, labels, source)
    row, rows = data.get("paper_row"), [printed.scenario for printed in paper_rows()]
    if isinstance(row, str) and row not in rows:
        message = f"'{row}' is not a row of the paper's Table 4{did_you_mean(row, rows)}"
        problems.append(Problem(message, source.locate(("paper_row",))))
    return problems


def _fault_labels(data: dict[str, Any]) -> list[str]:
    """Names of the faults, as far as the raw values tell."""
    given = data.get("faults")
    items = [item for item in given if isinstance(item, dict)] if isinstance(given, list) else []
    return numbered([str(item.get("name") or item.get("kind")) for item in items])


def _labels(data: dict[str, Any]) -> list[str]:
    """Names of the runs, as far as the raw values tell."""
    controllers = data.get("controllers")
    items = controllers if isinstance(controllers, list) else ({"kind": "passive"},)
    return [label_of(item) for item in items if isinstance(item, dict)]
