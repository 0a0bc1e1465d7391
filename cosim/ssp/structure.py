"""What an SSP says of a scenario: components, their connectors, and what is connected to what.

Vehicle and sensor are FMUs and so are components. Driver and controller are none: what they command
enters the system through its own inputs, which whoever runs it has to feed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

from cosim.fmi import KINDS, Description
from cosim.quantities import CHANNEL_QUANTITIES, DAMPERS, INPUT_QUANTITIES, TRUTH, Quantity
from cosim.wiring import DIMENSIONS, Wire, Wiring

VEHICLE: Final = "vehicle"
SENSOR: Final = "sensor"
SYSTEM: Final = None  # in a connection's place of an element


@dataclass(frozen=True)
class Connector:
    """An input or output by the name and unit of the FMU's variable."""

    name: str
    kind: Literal["input", "output"]
    type: str = "Real"
    unit: str | None = None


@dataclass(frozen=True)
class Component:
    """An FMU of the system."""

    name: str
    description: str
    connectors: tuple[Connector, ...]


@dataclass(frozen=True)
class Connection:
    """target = factor * source + offset; both ends are (element, connector)."""

    source: tuple[str | None, str]
    target: tuple[str | None, str]
    factor: float = 1.0
    offset: float = 0.0

    @property
    def converts(self) -> bool:
        """Whether the value is another one at the target."""
        return (self.factor, self.offset) != (1.0, 0.0)


@dataclass(frozen=True)
class Structure:
    """A system; `units` are SI exponents, factor and offset by name."""

    name: str
    description: str
    connectors: tuple[Connector, ...]
    components: tuple[Component, ...]
    connections: tuple[Connection, ...]
    units: Mapping[str, Mapping[str, float]]

    def components_only(self) -> Structure:
        """Return the system without connectors of its own, and what is connected to them."""
        inner = (c for c in self.connections if SYSTEM not in (c.source[0], c.target[0]))
        return replace(self, connectors=(), connections=tuple(inner))


def structure_of(
    name: str, description: str, wiring: Wiring, vehicle: Description, sensor: Description
) -> Structure:
    """Connect a vehicle FMU, wired by `wiring`, with a sensor FMU, whose variables have the
    quantities' own names; whatever it does not take is left out.
    """
    taken = {v.name for v in sensor.variables.values() if v.causality == "input"}
    estimates = _connectors(sensor, _of(sensor, "output"), "output")
    shown = {q.name for q in (*CHANNEL_QUANTITIES, *TRUTH)}
    wires = [wire for wire in wiring.outputs if wire.quantity.name in shown]
    car = (
        *_connectors(vehicle, [w.variable for w in wiring.inputs], "input"),
        *_connectors(vehicle, [w.variable for w in wires], "output"),
    )
    commands = [q for q in INPUT_QUANTITIES if q in DAMPERS or _wired(q, wiring.inputs)]
    components = (
        Component(VEHICLE, vehicle.model.description or "", car),
        Component(
            SENSOR,
            sensor.model.description or "",
            (*_connectors(sensor, _of(sensor, "input"), "input"), *estimates),
        ),
    )
    return Structure(
        name=name,
        description=description,
        connectors=(*(Connector(q.name, "input", "Real", q.unit) for q in commands), *estimates),
        components=components,
        connections=_connections(wiring, taken, estimates),
        units=_units(vehicle, sensor),
    )


def _connections(
    wiring: Wiring, taken: set[str], estimates: Sequence[Connector]
) -> tuple[Connection, ...]:
    outside = [
        Connection(
            (SYSTEM, w.quantity.name), (VEHICLE, w.variable), 1.0 / w.factor, -w.offset / w.factor
        )
        for w in wiring.inputs
    ]
    outside += [Connection((SYSTEM, q.name), (SENSOR, q.name)) for q in DAMPERS if q.name in taken]
    between = [
        Connection((VEHICLE, w.variable), (SENSOR, w.quantity.name), w.factor, w.offset)
        for w in wiring.outputs
        if w.quantity.name in taken
    ]
    results = [Connection((SENSOR, c.name), (SYSTEM, c.name)) for c in estimates]
    return (*outside, *between, *results)


def _wired(quantity: Quantity, wires: Iterable[Wire]) -> bool:
    return any(wire.quantity == quantity for wire in wires)


def _of(fmu: Description, causality: str) -> list[str]:
    return [name for name, v in fmu.variables.items() if v.causality == causality]


def _connectors(
    fmu: Description, names: Iterable[str], kind: Literal["input", "output"]
) -> tuple[Connector, ...]:
    return tuple(
        Connector(name, kind, KINDS.get(fmu.variables[name].type, "Real"), fmu.unit_of(name))
        for name in names
    )


def _units(*fmus: Description) -> dict[str, dict[str, float]]:
    """Return the units of the quantities and all that the FMUs define."""
    found: dict[str, dict[str, float]] = {name: {**base} for name, base in DIMENSIONS.items()}
    for fmu in fmus:
        for name, unit in fmu.units.items():
            found[name] = _base(unit.baseUnit)
    return found


def _base(base: Any) -> dict[str, float]:
    if base is None:
        return {}
    parts = {name: getattr(base, name) or 0 for name in ("kg", "m", "s", "A", "K", "mol", "cd")}
    parts |= {"rad": base.rad or 0, "factor": base.factor, "offset": base.offset}
    rest = {"factor": 1.0}
    return {name: value for name, value in parts.items() if value != rest.get(name, 0)}
