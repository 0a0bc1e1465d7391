"""Vehicle variants: named sets of parameters, such as a payload or worn dampers, for any scenario.

Those of the package lie in `cosim/variants/`, one YAML file each; a user's own is given by its
path. The parameters bear the FMU's names and units. Point masses of all variants together become
one load: its mass, its centre of gravity and its inertias about that (parallel axes).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

from pydantic import Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from cosim.errors import InputError, Problem, did_you_mean
from cosim.scenario.messages import problems_of
from cosim.scenario.model import Model, with_unit
from cosim.scenario.source import Source, read
from cosim.scenario.vehicle import Parameter

Value = bool | float | str
_NEEDS = "a variant needs name, description, source, and parameters or loads"


class PointMass(Model):
    """A part of the load; its place is measured from the empty vehicle's centre of gravity."""

    what: str = Field(min_length=1, description="what it is")
    mass_kg: float = Field(gt=0, description="mass", json_schema_extra=with_unit("kg"))
    x_m: float = Field(description="forward", json_schema_extra=with_unit("m"))
    y_m: float = Field(description="to the left", json_schema_extra=with_unit("m"))
    z_m: float = Field(description="up", json_schema_extra=with_unit("m"))


class Variant(Model):
    """A set of vehicle parameters."""

    name: str = Field(min_length=1, description="what messages call it")
    description: str = Field(min_length=1, description="one line")
    source: str = Field(min_length=1, description="where the numbers come from")
    parameters: dict[str, Parameter] = Field(
        default_factory=dict, description="start values by the FMU's own names, in its units"
    )
    loads: tuple[PointMass, ...] = Field(
        default=(), strict=False, description="masses put on the body"
    )

    @model_validator(mode="after")
    def _something(self) -> Variant:
        if not self.parameters and not self.loads:
            raise PydanticCustomError("nothing", "a variant needs parameters or loads")
        return self


@dataclass(frozen=True)
class Variants:
    """What the variants of a scenario make together.

    `parameters` are start values by name, `origin` the item of `vehicle.variants` that set each,
    `files` the variants' files by name.
    """

    parameters: Mapping[str, Value] = field(default_factory=dict)
    origin: Mapping[str, int] = field(default_factory=dict)
    files: Mapping[str, Path] = field(default_factory=dict)


def variant_names() -> tuple[str, ...]:
    """Return the names of the package's own variants."""
    return tuple(sorted(path.stem for path in _folder().glob("*.yaml")))


def combine(
    names: Sequence[str], own: Mapping[str, Value], source: Source
) -> tuple[Variants, list[Problem]]:
    """Return the variants called `names` as one, and all that is wrong with them.

    Two variants must not set the same parameter, unless the scenario's `own` parameters decide it.
    """
    found: dict[int, Variant] = {}
    files: dict[str, Path] = {}
    problems: list[Problem] = []
    for index, name in enumerate(names):
        try:
            variant, path = _read(name, source)
        except InputError as error:
            place = source.locate(("vehicle", "variants", index))
            problems += [p if p.place else Problem(p.message, place) for p in error.problems]
            continue
        if variant.name in files:
            sentence = f"variant '{variant.name}' is given twice"
            problems.append(Problem(sentence, source.locate(("vehicle", "variants", index))))
            continue
        files[variant.name] = path
        found[index] = variant
    parameters, origin, doubled = _merged(found, own)
    problems += [
        Problem(sentence, source.locate(("vehicle", "variants", index)))
        for index, sentence in doubled
    ]
    return Variants(parameters, origin, files), problems


def load_of(masses: Sequence[PointMass]) -> dict[str, float]:
    """Return the vehicle FMU's load parameters of point masses."""
    total = sum(mass.mass_kg for mass in masses)
    x, y, z = (
        sum(mass.mass_kg * getattr(mass, axis) for mass in masses) / total
        for axis in ("x_m", "y_m", "z_m")
    )
    xx, yy, zz = (
        sum(mass.mass_kg * (getattr(mass, axis) - centre) ** 2 for mass in masses)
        for axis, centre in (("x_m", x), ("y_m", y), ("z_m", z))
    )
    return {
        "Load.Mass": total,
        "Load.X": x,
        "Load.Y": y,
        "Load.Z": z,
        "Load.InertiaRoll": yy + zz,
        "Load.InertiaPitch": xx + zz,
        "Load.InertiaYaw": xx + yy,
    }


def _merged(
    found: Mapping[int, Variant], own: Mapping[str, Value]
) -> tuple[dict[str, Value], dict[str, int], list[tuple[int, str]]]:
    """Return all parameters, the variant that set each, and the conflicts at the later variant."""
    sets: list[tuple[int, Mapping[str, Value]]] = [(i, v.parameters) for i, v in found.items()]
    masses = [mass for variant in found.values() for mass in variant.loads]
    if masses:
        first = next(index for index, variant in found.items() if variant.loads)
        sets.append((first, load_of(masses)))
    parameters: dict[str, Value] = {}
    origin: dict[str, int] = {}
    conflicts: dict[tuple[int, int], str] = {}
    for index, values in sets:
        for name, value in values.items():
            if name in origin and name not in own:
                pair = origin[name], index
                both = " and ".join(f"'{found[i].name}'" for i in pair)
                conflicts.setdefault(
                    pair,
                    f"variants {both} both set {name}; take one, or set it under "
                    "vehicle.parameters",
                )
            parameters[name] = value
            origin.setdefault(name, index)
    return parameters, origin, [(max(pair), words) for pair, words in conflicts.items()]


def _folder() -> Path:
    return Path(str(resources.files("cosim") / "variants"))


def _read(name: str, scenario: Source) -> tuple[Variant, Path]:
    """Return the variant of a name or a file; raises `InputError` with everything wrong in it."""
    is_file = name.endswith((".yaml", ".yml"))
    path = scenario.folder / name if is_file else _folder() / f"{name}.yaml"
    if not path.is_file():
        choices = variant_names()
        if is_file:
            raise InputError(f"vehicle.variants: there is no file '{path}'")
        raise InputError(
            f"'{name}' is no variant; choose {', '.join(choices)}, or a .yaml file of your own"
            + did_you_mean(name, choices)
        )
    data, source, problems = read(path, _NEEDS)
    try:
        variant = Variant.model_validate(data)
    except ValidationError as error:
        problems += problems_of(error, data, source, Variant.model_json_schema())
    if problems:
        raise InputError(problems)
    return variant, path.resolve()
