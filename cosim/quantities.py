"""What the loop exchanges with a vehicle, by one name each, in SI units.

The names are those of the vehicle FMU that comes with the package. Another FMU takes its place
through a map from these quantities to its own variables (scenario field `vehicle.variables`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from sensor.channels import CHANNELS, COMMANDS, OUTPUTS, ROAD, STAGE

CORNERS: Final = ("FL", "FR", "RL", "RR")


@dataclass(frozen=True)
class Quantity:
    """A quantity, its SI unit, and where the built-in FMU has it (`scale` times `variable`);
    `boolean` is true or false, without a unit.
    """

    name: str
    unit: str
    description: str
    variable: str
    scale: float = 1.0
    required: bool = True
    boolean: bool = False


def _own(name: str, unit: str, description: str, required: bool = True) -> Quantity:
    return Quantity(name, unit, description, name, 1.0, required)


CHANNEL_QUANTITIES: Final = tuple(_own(c.name, c.unit, c.description) for c in CHANNELS)

TRUTH: Final = tuple(
    Quantity(
        f"Truth.{output.name}", "m/s", f"true suspension velocity {corner}, positive in extension",
        f"Car.C{corner}.q0p", -1.0,
    )
    for output, corner in zip(OUTPUTS, CORNERS, strict=True)
)  # fmt: skip

ESTIMATE: Final = tuple(_own(o.name, o.unit, o.description) for o in OUTPUTS)
ESTIMATE_DEVIATION: Final = tuple(
    _own(f"VRel.Deviation.{c}", "m/s", f"standard deviation expected of the error {c}", False)
    for c in CORNERS
)

POSE: Final = (
    _own("Car.tx", "m", "position of the centre of gravity, inertial x"),
    _own("Car.ty", "m", "position of the centre of gravity, inertial y"),
    _own("Car.Yaw", "rad", "yaw angle"),
)

SEAT: Final = tuple(
    _own(f"Car.Seat.a{axis}", "m/s2", f"acceleration at the seat, {axis}", False) for axis in "xyz"
)
TRAVEL: Final = tuple(
    _own(f"Car.C{c}.q0", "m", f"wheel travel {c}, positive in compression", False) for c in CORNERS
)
TYRE_LOAD: Final = tuple(
    _own(f"Car.Fz{c}", "N", f"vertical tyre force {c}", False) for c in CORNERS
)
ATTITUDE: Final = (
    _own("Car.tz", "m", "position of the centre of gravity, inertial z", False),
    _own("Car.Roll", "rad", "roll angle, positive right side down", False),
    _own("Car.Pitch", "rad", "pitch angle, positive nose down", False),
)
DAMPER_FORCE: Final = tuple(
    _own(f"Car.Damp{c}.Frc", "N", f"damper element force {c}, positive against extension", False)
    for c in CORNERS
)
DAMPER_SPEED: Final = tuple(
    _own(f"Car.Damp{c}.v", "m/s", f"damper element velocity {c}, positive in extension", False)
    for c in CORNERS
)
VALVE: Final = tuple(
    _own(f"Car.Damp{c}.Ctrl", "1", f"valve position of the damper {c}, 0 soft, 1 hard", False)
    for c in CORNERS
)
GRIP_SHARE: Final = tuple(
    _own(f"Car.GripShare{c}", "1", f"share of its grip that the tyre {c} uses", False)
    for c in CORNERS
)
RIDE: Final = (
    *SEAT, *TRAVEL, *TYRE_LOAD, *ATTITUDE, *DAMPER_FORCE, *DAMPER_SPEED, *VALVE, *GRIP_SHARE,
)  # fmt: skip

SENSOR_STAGE: Final = tuple(_own(c.name, c.unit, c.description, False) for c in STAGE)
ROAD_HEIGHT: Final = tuple(_own(c.name, c.unit, c.description, False) for c in ROAD)
RECORDED: Final = (*POSE, *RIDE, *SENSOR_STAGE, *ROAD_HEIGHT)

STEER: Final = _own("DM.Steer.Ang", "rad", "steering-wheel angle, positive to the left")
GAS: Final = _own("DM.Gas", "1", "accelerator pedal, 0 to 1")
BRAKE: Final = _own("DM.Brake", "1", "brake pedal, 0 to 1")
DRIVER: Final = (STEER, GAS, BRAKE)

DAMPERS: Final = tuple(
    _own(c.name, c.unit, f"damper command {corner}, 0 soft, 1 hard", False)
    for c, corner in zip(COMMANDS, CORNERS, strict=True)
)

OUTPUT_QUANTITIES: Final = (*CHANNEL_QUANTITIES, *TRUTH, *RECORDED)
INPUT_QUANTITIES: Final = (*DRIVER, *DAMPERS)
QUANTITIES: Final = {q.name: q for q in (*OUTPUT_QUANTITIES, *INPUT_QUANTITIES)}

# What a controller FMU is given, of which it takes what it likes, and what it has to give.
SENSOR_VALID: Final = Quantity(
    "Sensor.Valid", "1", "whether the suspension velocities count", "Sensor.Valid",
    required=False, boolean=True,
)  # fmt: skip
BODY_VELOCITY: Final = tuple(
    _own(f"VBody.{c}", "m/s", f"velocity of the body at the corner {c}, positive upward", False)
    for c in CORNERS
)
BODY_ACCELERATION: Final = tuple(
    _own(f"ABody.{c}", "m/s2", f"acceleration of the body at the corner {c}, positive up", False)
    for c in CORNERS
)
CONTROLLER_INPUTS: Final = (
    *(replace(q, required=False) for q in (*CHANNEL_QUANTITIES, *ESTIMATE)),
    *ESTIMATE_DEVIATION, *BODY_VELOCITY, *BODY_ACCELERATION, SENSOR_VALID,
)  # fmt: skip
CONTROLLER_OUTPUTS: Final = DAMPERS
