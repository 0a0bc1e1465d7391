"""What a scenario comes to: every value with unit and origin, road, files, length of the run."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.inspect.facts import Facts, number

if TYPE_CHECKING:
    from pydantic import BaseModel

    from cosim.fmi import Description
    from cosim.scenario.schema import Scenario

Value = tuple[str, Any, str, str]  # path, value, unit, 'given' or 'default'


def inspect(path: Path) -> Facts:
    """Return the facts of a scenario, its road built and its files hashed.

    Raises `InputError` with everything wrong in it, as `cosim run` would.
    """
    from cosim.assembly import STEP_S, checked_parts
    from cosim.scenario.load import load

    scenario = load(path)
    _, description, course, plan = checked_parts(scenario)
    values = [*_resolved(scenario, description), *_parameters(scenario, description)]
    wanted = None if scenario.duration == "lap" else float(scenario.duration)
    expected = plan.expected_s if wanted is None else min(wanted, plan.expected_s)
    data: dict[str, Any] = {
        "kind": "scenario",
        "file": str(path),
        "name": scenario.name,
        "description": scenario.description,
        "values": [{"path": p, "value": v, "unit": u, "origin": o} for p, v, u, o in values],
        "road": {
            "name": course.track.name,
            "length_m": float(course.track.length),
            "closed": bool(course.track.closed),
            "surface": scenario.road.surface_name,
            "obstacles": len(scenario.road.obstacles),
        },
        "expected_duration_s": round(expected, 3),
        "expected_samples": math.floor(expected / STEP_S) + 1,
        "sample_interval_s": STEP_S,
        "runs": [
            {"name": c.label, **c.model_dump(mode="json", exclude={"name"})}
            for c in scenario.controllers
        ],
        "limits": [limit.model_dump(mode="json") for limit in scenario.limits],
        "files": _files(scenario, description.path, course.file),
    }
    facts = Facts(f"{path}: scenario '{scenario.name}'", data)
    _tables(facts, values)
    return facts


def _resolved(scenario: Scenario, description: Description) -> Iterator[Value]:
    """Yield the fields, with the seed and the units that the fields alone do not know."""
    for path, value, unit, origin in _values(scenario, ""):
        if path.endswith(".seed") and value is None:
            yield path, scenario.seed, unit, "from seed"
        elif path.startswith("vehicle.parameters."):
            name = path.removeprefix("vehicle.parameters.")
            yield path, value, description.unit_of(name) or "", origin
        else:
            yield path, value, unit, origin


def _parameters(scenario: Scenario, description: Description) -> Iterator[Value]:
    """Yield the vehicle's parameters that variants stand for."""
    for name, value in scenario.parameters.items():
        if name not in scenario.vehicle.parameters:
            variant = scenario.vehicle.variants[scenario.variants.origin[name]]
            origin = f"variant {variant}"
            yield f"vehicle.parameters.{name}", value, description.unit_of(name) or "", origin


def _values(model: BaseModel, path: str, inherited: str = "") -> Iterator[Value]:
    """Yield every field below a model; a part that is not given makes all below it a default."""
    from pydantic import BaseModel

    for name, info in type(model).model_fields.items():
        value, where = getattr(model, name), f"{path}{name}"
        origin = inherited or ("given" if name in model.model_fields_set else "default")
        extra = info.json_schema_extra
        unit = str(extra.get("unit", "")) if isinstance(extra, dict) else ""
        below = "default" if origin == "default" else ""
        if isinstance(value, BaseModel):
            yield from _values(value, f"{where}.", below)
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for i, item in enumerate(value):
                yield from _values(item, f"{where}.{i}.", below)
        elif isinstance(value, dict):
            for key, item in value.items():
                yield from _entry(f"{where}.{key}", item, origin)
        else:
            yield where, list(value) if isinstance(value, tuple) else value, unit, origin


def _entry(where: str, item: Any, origin: str) -> Iterator[Value]:
    from pydantic import BaseModel

    if isinstance(item, BaseModel):
        yield from _values(item, f"{where}.")
    else:
        yield where, item, "", origin


def _files(scenario: Scenario, fmu: Path, road: Path) -> list[dict[str, str]]:
    from cosim.provenance import sha256

    files: dict[str, Path | None] = {
        "scenario": scenario.file, "vehicle": fmu, "road": road, **_sensors(scenario),
        **_controllers(scenario),
        **{f"variant {n}": p for n, p in scenario.variants.files.items()},
        **{f"fault {n}": p for n, p in scenario.fault_files.items()},
    }  # fmt: skip
    return [
        {"what": what, "path": str(path), "sha256": sha256(path) if path.is_file() else "missing"}
        for what, path in files.items()
        if path is not None
    ]


def _sensors(scenario: Scenario) -> dict[str, Path | None]:
    """Return the files of the sensor and of the estimators that runs have of their own."""
    from cosim.sensor import estimator_file

    files = {"sensor": estimator_file(scenario, scenario.sensor)}
    for controller in scenario.controllers:
        file = estimator_file(scenario, controller.sensor_of_run(scenario.sensor))
        if file not in files.values():
            files[f"sensor of {controller.label}"] = file
    return files


def _controllers(scenario: Scenario) -> dict[str, Path | None]:
    """Return the FMUs that are controllers."""
    from cosim.scenario.controllers import ControllerFmu

    fmus = (c for c in scenario.controllers if isinstance(c, ControllerFmu))
    return {f"controller {c.label}": scenario.resolve(c.file) for c in fmus}


def _tables(facts: Facts, values: list[Value]) -> None:
    d = facts.data
    road = d["road"]
    facts.pairs(
        "What it comes to",
        [
            ("description", d["description"]),
            ("road", f"{road['name']}, {road['length_m']:.2f} m"
             + (", closed" if road["closed"] else "")),
            ("surface", road["surface"] or "the file's own"),
            ("obstacles", str(road["obstacles"] or "")),
            ("runs", ", ".join(run["name"] for run in d["runs"])),
            ("expected duration", f"{d['expected_duration_s']:.1f} s"),
            ("expected samples", f"{d['expected_samples']} of {d['sample_interval_s']:g} s"),
        ],
    )  # fmt: skip
    facts.table(
        "Values", ("field", "value", "unit", "origin"),
        [
            (p, _text(v), u, o)
            for p, v, u, o in values
            if not p.startswith("limits.") and p not in ("name", "description")
        ],
    )  # fmt: skip
    facts.table(
        "Limits", ("metric", "min", "max", "surface"),
        [(m["metric"], number(m["min"]), number(m["max"]), m.get("surface") or "")
         for m in d["limits"]],
    )  # fmt: skip
    facts.table(
        "Files", ("what", "file", "SHA-256"),
        [(f["what"], f["path"], f["sha256"]) for f in d["files"]],
    )  # fmt: skip


def _text(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:.10g}"
    if isinstance(value, list):
        return ", ".join(map(_text, value)) or "-"
    return str(value)
