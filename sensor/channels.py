"""The sensor's fourteen inputs and four outputs, and the signals beside them: names, units, signs.
Nothing else in the project repeats them.

The order is that of Table 2 of the paper. Names are the variable names of the vehicle FMU. Units
are SI throughout; where the paper's table has degrees, `paper_unit` says so and the network's own
normalisation makes up the difference. Axes are ISO 8855: x forward, y left, z up; wheels in the
order front left, front right, rear left, rear right.

Beside the paper's signals stand the damper commands (`COMMANDS`), what production sensors deliver
in place of the ideal channels (`STAGE`), and the road's height below the wheels (`ROAD`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.errors import SensorError

SAMPLE_RATE_HZ = 100


@dataclass(frozen=True)
class Channel:
    """One signal: its name in the vehicle FMU, its SI unit, what is positive, and its line in the
    paper's Table 2 (number 0 where it has none).
    """

    name: str
    unit: str
    description: str
    sign: str
    paper_number: int = 0
    paper_name: str = ""
    paper_unit: str = ""


_WHEELS = {"FL": "front left", "FR": "front right", "RL": "rear left", "RR": "rear right"}


def _acceleration(axis: str, sign: str, number: int) -> Channel:
    description = (
        f"acceleration of the centre of gravity along the body's {axis} axis, gravity excluded"
    )
    paper = f"Sprung mass acceleration ({axis.upper()} axis)"
    return Channel(f"Car.a{axis}", "m/s2", description, sign, number, paper, "m/s2")


def _rate(name: str, axis: str, sign: str, number: int) -> Channel:
    paper = f"Sprung mass angular rate ({axis.upper()} axis)"
    return Channel(
        f"Car.{name}",
        "rad/s",
        f"body's rotation rate about its {axis} axis",
        sign,
        number,
        paper,
        "deg/s",
    )


def _steer(wheel: str, number: int) -> Channel:
    paper = f"Steering angle of {_WHEELS[wheel]} wheel"
    description = f"steering angle of the {_WHEELS[wheel]} road wheel"
    return Channel(
        f"Car.SteerAngle{wheel}", "rad", description, "positive to the left", number, paper, "deg"
    )


def _wheel_speed(wheel: str, number: int) -> Channel:
    paper = f"Wheel speed of {_WHEELS[wheel]} wheel"
    description = f"rotation speed of the {_WHEELS[wheel]} wheel times a constant rolling radius"
    return Channel(f"Car.v{wheel}", "m/s", description, "positive forward", number, paper, "m/s")


def _velocity(wheel: str, number: int) -> Channel:
    paper = f"Unsprung mass relative velocity (Z axis) {_WHEELS[wheel]}"
    description = f"suspension velocity of the {_WHEELS[wheel]} wheel, body relative to wheel"
    return Channel(
        f"VRel.{wheel}", "m/s", description, "positive in extension", number, paper, "m/s"
    )


CHANNELS: tuple[Channel, ...] = (
    _acceleration("x", "positive when speeding up", 1),
    _acceleration("y", "positive to the left", 2),
    _acceleration("z", "positive upward", 3),
    _rate("RollVel", "x", "positive when the left side rises", 4),
    _rate("PitchVel", "y", "positive when the nose goes down", 5),
    _rate("YawRate", "z", "positive when turning left", 6),
    Channel(
        "Car.vx", "m/s", "forward velocity of the vehicle", "positive forward",
        7, "Vehicle's longitudinal velocity", "m/s",
    ),
    _steer("FL", 8),
    _steer("FR", 9),
    _wheel_speed("FL", 10),
    _wheel_speed("FR", 11),
    _wheel_speed("RL", 12),
    _wheel_speed("RR", 13),
    Channel(
        "Steer.WhlAng", "rad", "steering-wheel angle", "positive to the left",
        14, "Vehicle's steering angle", "deg",
    ),
)  # fmt: skip

OUTPUTS: tuple[Channel, ...] = tuple(
    _velocity(wheel, n) for n, wheel in enumerate(_WHEELS, start=1)
)

# Held over the interval that ends at the sample; the first row has the initial command.
COMMANDS: tuple[Channel, ...] = tuple(
    Channel(
        f"Car.SuspControl.Damper{wheel}.CtrlOut",
        "1",
        f"command of the {place} damper, held over the interval that ends at the sample",
        "0 soft, 1 hard",
    )
    for wheel, place in _WHEELS.items()
)
PASSIVE_COMMAND: Final = 0.3  # stands for the passive damper, whose curve lies at 0.27 to 0.34


def _staged(channel: Channel, name: str) -> Channel:
    """Return the channel as a production sensor delivers it."""
    description = f"production sensor, before noise: {channel.description}"
    return replace(
        channel, name=name, description=description, paper_number=0, paper_name="", paper_unit=""
    )


def _stage() -> tuple[Channel, ...]:
    renamed = {"Car.vx": "Sensor.Esc.vx"}
    renamed |= {f"Car.v{wheel}": f"Sensor.v{wheel}" for wheel in _WHEELS}
    moved = ("Car.ax", "Car.ay", "Car.az", "Car.RollVel", "Car.PitchVel", "Car.YawRate")
    renamed |= {name: name.replace("Car.", "Sensor.Imu.") for name in moved}
    return tuple(_staged(c, renamed[c.name]) for c in CHANNELS if c.name in renamed)


STAGE: tuple[Channel, ...] = _stage()

ROAD: tuple[Channel, ...] = tuple(
    Channel(f"Car.zRoad{wheel}", "m", f"road height below the {place} wheel", "positive upward")
    for wheel, place in _WHEELS.items()
)

CHANNEL_NAMES: tuple[str, ...] = tuple(channel.name for channel in CHANNELS)
CHANNEL_UNITS: tuple[str, ...] = tuple(channel.unit for channel in CHANNELS)
OUTPUT_NAMES: tuple[str, ...] = tuple(channel.name for channel in OUTPUTS)
OUTPUT_UNITS: tuple[str, ...] = tuple(channel.unit for channel in OUTPUTS)

# Where the stage's signals stand among the channels; the three steering angles stay as they are.
STAGED: Final = tuple(i for i, c in enumerate(CHANNELS) if "Steer" not in c.name)


def stage_channels(
    channels: npt.NDArray[np.floating], stage: npt.NDArray[np.floating]
) -> npt.NDArray[np.floating]:
    """Return the 14 channels with the production sensors' signals in their places: (n, 14) and
    (n, 11) -> (n, 14), or one sample (14,) and (11,) -> (14,), in the order of `CHANNELS`.
    """
    staged = np.array(channels)
    staged[..., list(STAGED)] = stage
    return staged


def differences(
    names: Sequence[str], units: Sequence[str], expected: Sequence[Channel]
) -> list[str]:
    """Compare names and units, position by position, with the expected channels; one sentence per
    difference.
    """
    problems = []
    if len(names) != len(expected) or len(units) != len(names):
        problems.append(
            f"it has {len(names)} names and {len(units)} units, where {len(expected)} belong."
        )
    for position, (name, unit, channel) in enumerate(
        zip(names, units, expected, strict=False), start=1
    ):
        if name != channel.name:
            problems.append(f"channel {position} is {name!r}, where {channel.name!r} belongs.")
        elif unit != channel.unit:
            problems.append(f"channel {name!r} is in {unit!r}, where {channel.unit!r} belongs.")
    return problems


def check_channels(
    source: str, names: Sequence[str], units: Sequence[str], expected: Sequence[Channel]
) -> None:
    """Raise SensorError naming every channel of `source` whose name, place or unit differs from the
    expected.
    """
    problems = differences(names, units, expected)
    if problems:
        raise SensorError(f"{source}: " + " ".join(problems))
