"""A test rig for the vehicle FMU: runs with held commands, and straight roads made to measure.

Everything goes through the FMU's own interface (`cosim.fmi.Slave`); nothing here knows the C code.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.fmi import Description, Slave, Value
from cosim.road.crg import write_crg
from cosim.road.grid import RoadGrid
from cosim.road.track import DS, Track
from cosim.vehicle import builtin_fmu

Array = npt.NDArray[np.float64]


CORNERS = ("FL", "FR", "RL", "RR")
INPUTS = (
    "DM.Steer.Ang", "DM.Gas", "DM.Brake", "Road.Friction",
    *(f"Car.SuspControl.Damper{c}.CtrlOut" for c in CORNERS),
)  # fmt: skip
STEER, GAS, BRAKE, FRICTION, DAMPERS = 0, 1, 2, 3, slice(4, 8)
G = 9.81


def each(pattern: str, value: Value | tuple[Value, Value]) -> dict[str, Value]:
    """Start values of one per-corner parameter ("@" is the corner): one value or (front, rear)."""
    front, rear = value if isinstance(value, tuple) else (value, value)
    return {pattern.replace("@", c): front if c[0] == "F" else rear for c in CORNERS}


CENTRED: dict[str, Value] = {"Body.CogToLeft": 0.8125, "Body.CogToRight": 0.8125}
NO_DRAG: dict[str, Value] = {"Tire.QSY1": 0.0, "Aero.Area": 0.0}
NO_GRIP: dict[str, Value] = {
    "Tire.PKX1": 0.01, "Tire.PKX2": 0.0, "Tire.PKY1": -0.01, "Tire.QDZ1": 0.0,
    "Tire.CarcassDampingX": 0.0, "Tire.CarcassDampingY": 0.0, "Tire.StandstillDamping": 0.0,
    "Tire.LoadDependentRadius": False,
}  # fmt: skip
NO_KINEMATICS: dict[str, Value] = {
    k: v
    for name in (
        "RollCentre", "Recession", "RecessionCurve", "KnucklePitch",
        "Camber", "CamberCurve", "BumpSteer",
    )
    for k, v in each(f"Kin.{name}@", 0.0).items()
}  # fmt: skip
TABLE_SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0)  # of the damper tables [m/s]


def linear_dampers(front: float, rear: float) -> dict[str, Value]:
    """Start values that make the passive dampers linear: N s/m at the wheel."""
    start: dict[str, Value] = {
        "Damp.Passive": True,
        **each("Damp.Scale@", (front / 1e3, rear / 1e3)),
    }
    for k, v in enumerate(TABLE_SPEEDS, 1):
        start |= {f"Damp.Passive{way}{k}": 1e3 * v for way in ("Rebound", "Compression")}
    return start


@cache
def description(version: int = 3) -> Description:
    return Description(builtin_fmu(version))


@cache
def output_names() -> tuple[str, ...]:
    return tuple(n for n, v in description().variables.items() if v.causality == "output")


@cache
def parameter(name: str) -> float:
    """The FMU's start value of a parameter."""
    return float(description().variables[name].start)


class Rig:
    """One instance on the rig; `inputs` in the order of `INPUTS`, outputs by name."""

    def __init__(
        self, start: Mapping[str, Value] = {}, *, version: int = 3, h: float = 0.01
    ) -> None:
        self.h, self.k = h, 0
        self._names = output_names()
        self._slave = Slave(description(version), INPUTS, self._names)
        self.inputs = self._slave.inputs
        self.inputs[FRICTION] = 1.0
        held = {n: float(start[n]) for n in INPUTS if n in start}
        for name, value in held.items():
            self.inputs[INPUTS.index(name)] = value
        try:
            self._slave.initialise({n: v for n, v in start.items() if n not in INPUTS})
        except BaseException:
            self._slave.close()
            raise
        self._slave.read()

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self._slave.close()

    def __getitem__(self, name: str) -> float:
        return float(self._slave.outputs[self._names.index(name)])

    @property
    def t(self) -> float:
        return self.k * self.h

    @property
    def outputs(self) -> Array:
        return self._slave.outputs

    def step(self) -> None:
        self._slave.step(self.k, self.h)
        self._slave.read()
        self.k += 1


class Record:
    """All outputs over time: `record["Car.ax"]` (n,), `record.corners("Car.Fz@")` (n, 4)."""

    def __init__(self, t: Array, rows: Array) -> None:
        self.t, self.rows = t, rows

    def __getitem__(self, name: str) -> Array:
        return self.rows[:, output_names().index(name)]

    def corners(self, pattern: str) -> Array:
        return np.column_stack([self[pattern.replace("@", c)] for c in CORNERS])


Drive = Callable[[Rig], None]  # sets rig.inputs for the step to come


def coast(_: Rig) -> None:
    """No command at all."""


def run(
    seconds: float,
    start: Mapping[str, Value] = {},
    drive: Drive = coast,
    *,
    version: int = 3,
    h: float = 0.01,
) -> Record:
    """Run one instance and return its outputs at t = 0, h, ..., `seconds`."""
    count = round(seconds / h)
    rows = np.empty((count + 1, len(output_names())))
    with Rig(start, version=version, h=h) as rig:
        rows[0] = rig.outputs
        for k in range(count):
            drive(rig)
            rig.step()
            rows[k + 1] = rig.outputs
    return Record(np.arange(count + 1, dtype=np.float64) * h, rows)


def steer_to(angle: float, ramp: float = 0.0) -> Drive:
    """Turn the hand wheel to `angle` [rad], linearly over `ramp` [s]."""

    def drive(rig: Rig) -> None:
        rig.inputs[STEER] = angle * (min(rig.t / ramp, 1.0) if ramp > 0.0 else 1.0)

    return drive


class Cruise:
    """Hold a speed [m/s] with the accelerator alone (PI); call before setting the other inputs."""

    def __init__(self, speed: float) -> None:
        self.speed, self._sum = speed, 0.0

    def __call__(self, rig: Rig) -> None:
        error = self.speed - rig["Car.vx"]
        self._sum += 0.3 * error * rig.h
        rig.inputs[GAS] = float(np.clip(0.3 * error + self._sum, 0.0, 1.0))


# ---------------------------------------------------------------- roads


def straight_track(length: float, grade: float = 0.0) -> Track:
    """A straight track along x from x = -20 m."""
    s: Array = np.arange(round((length + 20.0) / DS) + 1, dtype=np.float64) * DS - 20.0
    zero = np.zeros_like(s)
    return Track(
        name="rig", length=length, closed=False, s=s, x=s.copy(), y=zero, z=grade * s, heading=zero,
        curvature=zero, grade=zero + grade, banking=zero, speed_limit=zero + np.inf,
    )  # fmt: skip


def straight_road(
    path: Path,
    elevation: Callable[[Array, Array], Array],
    *,
    length: float = 100.0,
    columns: Array | None = None,
    grade: float = 0.0,
) -> str:
    """Write a straight road along x from -20 m with `elevation(s[:, None], v)` [m] and a grade."""
    track = straight_track(length, grade)
    v = np.array([-4.5, 4.5]) if columns is None else columns
    grid = np.broadcast_to(elevation(track.s[:, None], v), (len(track.s), len(v)))
    write_crg(path, track, RoadGrid(track.s, v, grid.astype(np.float32)))
    return str(path)


def cosine_bump(s: Array, start: float, length: float, height: float) -> Array:
    """One (1 - cos) bump."""
    u = np.clip((s - start) / length, 0.0, 1.0)
    return np.asarray(0.5 * height * (1.0 - np.cos(2.0 * np.pi * u)))
