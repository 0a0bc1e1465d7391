"""The vehicle at one speed as a linear system, its dampers taken out of it.

The dampers' curves are straight lines in the linear system, with the slope that statistical
linearisation gives them on the road the filter is made for; what the true curves do beyond that is
an input of its own, a force along each wheel's extension.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.fmi import Description, Value
from cosim.linearise import LinearModel, linearise_on_road
from cosim.linearise.fmu import STEP, Steps
from cosim.quantities import CORNERS
from sensor.channels import CHANNEL_NAMES, STAGE
from sensor.conditions import PRODUCTION_PARAMETERS

Array = npt.NDArray[np.float64]

STEER, GAS = "DM.Steer.Ang", "DM.Gas"
OUTPUTS: Final = (
    *(name for name in CHANNEL_NAMES if "Steer" not in name),
    *(channel.name for channel in STAGE if "Imu" in channel.name),
)
# coordinates that nothing depends on straight on, and brakes that are open
IDLE: Final = (
    *("position.x", "position.y", "attitude.z", "angle", "brake_torque", "brake_windup"),
    *("dissipated", "supplied", "valve"),
)
TABLE_SPEEDS: Final = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0)  # of the FMU's passive damper curve [m/s]
CHANGE: Final = 0.2  # of the damping, to find what a damper's force does


@dataclass(frozen=True)
class Plant:
    """The vehicle at `speed` [m/s] over a road: `model` has the inputs steering-wheel angle, pedal
    and d(elevation)/dt under each wheel, the outputs `OUTPUTS`.

    `damping` (4,) [N s/m] is what the linear dampers have at the wheel, `force` (n, 4) the
    columns of B for a force [N] on each wheel's extension, against it; `still` (p,) the outputs
    straight on over an even road and `rest` (n,) the state there, seen from a car at rest.
    """

    speed: float
    model: LinearModel
    damping: Array
    force: Array
    still: Array
    rest: Array


def plant(description: Description, speed: float, damping: Array) -> Plant:
    """Linearise the vehicle at `speed` [m/s] with `damping` (4,) [N s/m] at the wheels; raises
    `FmuError`.
    """
    first, more = (_linear(description, speed, scale * damping) for scale in (1.0, 1.0 + CHANGE))
    rates = [first.states.index(f"travel_rate.{c}") for c in CORNERS]
    # A damper pulls with damping * extension speed, and the travel rate is minus that speed.
    force = -(more.A - first.A)[:, rates] / (CHANGE * damping)
    still, rest = _straight_on(description, speed, first.states)
    return Plant(speed, first, damping, force, still, rest)


def damped(at: Plant, damping: Array) -> Plant:
    """Return the plant with other linear dampers, `damping` (4,) [N s/m] at the wheels."""
    A = at.model.A.copy()
    rates = [at.model.states.index(f"travel_rate.{c}") for c in CORNERS]
    A[:, rates] -= at.force * (damping - at.damping)
    return replace(at, model=replace(at.model, A=A), damping=damping)


def parameters() -> dict[str, Value]:
    """Return the FMU's start values: those of the production sensors, which the ideal channels do
    not feel, but no rings with teeth.
    """
    return {**PRODUCTION_PARAMETERS, "Sensor.WheelSpd.Teeth": 0.0, "Damp.Passive": True}


def _linear(description: Description, speed: float, damping: Array) -> LinearModel:
    start = {"Init.Velocity": speed, **parameters(), **_straight(damping)}
    model = linearise_on_road(description, start, {STEER: 0.0, GAS: 0.0}, OUTPUTS)
    return model.without_states(IDLE).driven_over_elevation(speed)


def _straight(damping: Array) -> Mapping[str, Value]:
    """Return the FMU's damper parameters for straight curves."""
    slope = 1000.0  # of the table, which each damper's scale makes its own [N s/m]
    values: dict[str, Value] = {
        f"Damp.Passive{way}{k}": slope * v
        for way in ("Rebound", "Compression")
        for k, v in enumerate(TABLE_SPEEDS, 1)
    }
    for corner, c in zip(CORNERS, damping / slope, strict=True):
        values[f"Damp.Scale{corner}"] = float(c)
    return values


def _straight_on(
    description: Description, speed: float, states: Sequence[str]
) -> tuple[Array, Array]:
    """Return outputs and state straight on; the FMU starts in this state."""
    ends = []
    for v in (0.0, speed):
        start = {"Init.Velocity": v, **parameters()}
        with Steps(description, start, {STEER: 0.0, GAS: 0.0}, OUTPUTS) as steps:
            ends.append((steps.words, steps.step(steps.words, steps.inputs, STEP).outputs))
            layout = steps.layout
    difference = layout.difference(ends[1][0], ends[0][0])
    known = dict(zip(layout.coordinates, difference, strict=True))
    return ends[1][1], np.array([known.get(name, 0.0) for name in states])
