"""What is in which CAN frame; `suspension.dbc` and its page are made of this table.

Classic CAN: 11-bit identifiers, at most 8 bytes, little-endian. One raw value of every signal that
has a unit means "no value": the lowest of a signed one, the highest of an unsigned one.

A signal's step is a whole fraction of the step of a production car's sensor (sensor.conditions)
where that is a round number: such a measurement passes the bus unchanged.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from sensor.channels import CHANNELS, COMMANDS, OUTPUTS, SAMPLE_RATE_HZ, Channel

BENCH: Final = "BENCH"
SENSOR: Final = "SENSOR"
CYCLE_MS: Final = 1000 // SAMPLE_RATE_HZ

UNITS: Final[Mapping[str, tuple[str, float]]] = {
    "m/s^2": ("m/s2", 1.0),
    "m/s": ("m/s", 1.0),
    "km/h": ("m/s", 1.0 / 3.6),
    "deg/s": ("rad/s", math.pi / 180.0),
    "deg": ("rad", math.pi / 180.0),
    "ms": ("s", 1e-3),
    "": ("1", 1.0),
}
"""A unit on the bus: the SI unit of the same quantity, and what it is in that."""


@dataclass(frozen=True)
class Coding:
    """A number on the bus: its unit there, the value of one step in it, and its bits."""

    unit: str
    step: float
    bits: int
    signed: bool = True

    @property
    def no_value(self) -> int:
        """The raw value that stands for none."""
        return -(1 << self.bits - 1) if self.signed else (1 << self.bits) - 1

    @property
    def raw_range(self) -> tuple[int, int]:
        """Smallest and largest raw value of a number."""
        if self.signed:
            return self.no_value + 1, -self.no_value - 1
        return 0, self.no_value - 1


@dataclass(frozen=True)
class BusSignal:
    """One signal of a frame: what it is, and its number; `coding` is None for a bare integer of
    `bits`. `words` are the raw values that have a meaning of their own.
    """

    name: str
    description: str
    bits: int
    coding: Coding | None = None
    words: tuple[tuple[int, str], ...] = ()

    @property
    def signed(self) -> bool:
        """Whether the raw value is."""
        return self.coding is not None and self.coding.signed


@dataclass(frozen=True)
class Frame:
    """One CAN frame. `cyclic`: once per sample; else when there is something to say."""

    name: str
    identifier: int
    sender: str
    description: str
    signals: tuple[BusSignal, ...]
    cyclic: bool = True

    @property
    def receiver(self) -> str:
        """The other end."""
        return SENSOR if self.sender == BENCH else BENCH

    @property
    def size(self) -> int:
        """Bytes of data."""
        return -(-sum(signal.bits for signal in self.signals) // 8)


ACCELERATION: Final = Coding("m/s^2", 0.000981, 16)  # half a step of the production IMU
ROTATION: Final = Coding("deg/s", 0.005, 16)  # half a step of the production IMU
SPEED: Final = Coding("km/h", 1.0 / 2048.0, 20)  # 1/64 of a step of the production sensor
STEERING_WHEEL: Final = Coding("deg", 0.025, 16)  # a quarter of a step of the production sensor
ROAD_WHEEL: Final = Coding("deg", 0.002, 16)
COMMAND: Final = Coding("", 0.00025, 12, signed=False)
VELOCITY: Final = Coding("m/s", 0.0002, 16)
DEVIATION: Final = Coding("m/s", 0.00025, 12, signed=False)
AGE: Final = Coding("ms", 0.01, 15, signed=False)

COUNTER: Final = BusSignal("SampleCounter", "number of the sample, from 0, modulo 65536", 16)
AGE_OF_ANSWER: Final = BusSignal(
    "Age", "time from the sample's first frame at the sensor to the answer", AGE.bits, AGE
)
VALID: Final = BusSignal("Valid", "1 where the estimate counts", 1)
SESSION: Final = BusSignal("Session", "number of the run, drawn by the bench", 16)
START: Final = 1  # values of Command
END: Final = 2


def bus_name(name: str) -> str:
    """Return the name of a quantity as a DBC can have it, `Car.ax` as `Car_ax`."""
    return name.replace(".", "_")


def deviation_name(output: Channel) -> str:
    """Return the name of the standard deviation that belongs to an output."""
    return f"VRel.Deviation.{output.name.split('.')[1]}"


def _coding(channel: Channel) -> Coding:
    if "CtrlOut" in channel.name:
        return COMMAND
    if channel.name == "Steer.WhlAng":
        return STEERING_WHEEL
    by_unit = {"m/s2": ACCELERATION, "rad/s": ROTATION, "rad": ROAD_WHEEL, "m/s": SPEED}
    return by_unit[channel.unit]


def _frame(name: str, identifier: int, description: str, *names: str) -> Frame:
    """Return a frame from the bench with channels or commands by name."""
    known = {c.name: c for c in (*CHANNELS, *COMMANDS)}
    signals = [
        BusSignal(bus_name(n), f"{c.description}, {c.sign}", _coding(c).bits, _coding(c))
        for n, c in ((n, known[n]) for n in names)
    ]
    return Frame(name, identifier, BENCH, description, (COUNTER, *signals))


def _velocities(name: str, identifier: int, axle: str, outputs: tuple[Channel, ...]) -> Frame:
    signals = [
        BusSignal(bus_name(o.name), f"{o.description}, {o.sign}", VELOCITY.bits, VELOCITY)
        for o in outputs
    ]
    description = f"estimated suspension velocities of the {axle} axle"
    return Frame(name, identifier, SENSOR, description, (COUNTER, *signals, AGE_OF_ANSWER, VALID))


def _deviations(name: str, identifier: int) -> Frame:
    signals = [
        BusSignal(
            bus_name(deviation_name(o)),
            f"standard deviation of the error that the sensor expects of {o.name}",
            DEVIATION.bits,
            DEVIATION,
        )
        for o in OUTPUTS
    ]
    return Frame(name, identifier, SENSOR, "how sure the sensor is", (COUNTER, *signals))


CONTROL: Final = Frame(
    "BenchControl",
    0x100,
    BENCH,
    "begins and ends a run; the sensor forgets all samples and answers with SensorStatus",
    (SESSION, BusSignal("Command", "what the bench does", 8, words=((1, "start"), (2, "end")))),
    cyclic=False,
)
STATUS: Final = Frame(
    "SensorStatus",
    0x101,
    SENSOR,
    "answer to BenchControl",
    (
        SESSION,
        BusSignal("FramesLost", "frames of this run that the sensor did not have in time", 16),
        BusSignal("Fingerprint", "CRC-32 of the estimator's file or name, 0 if not told", 32),
    ),
    cyclic=False,
)
TO_SENSOR: Final = (
    _frame("ImuAcceleration", 0x110, "accelerations", "Car.ax", "Car.ay", "Car.az"),
    _frame(
        "ImuRotation", 0x111, "rotation rates", "Car.RollVel", "Car.PitchVel", "Car.YawRate"
    ),
    _frame("WheelSpeedFront", 0x112, "wheel speeds of the front axle", "Car.vFL", "Car.vFR"),
    _frame("WheelSpeedRear", 0x113, "wheel speeds of the rear axle", "Car.vRL", "Car.vRR"),
    _frame("VehicleSpeed", 0x114, "speed of the vehicle", "Car.vx"),
    _frame(
        "Steering", 0x115, "steering", "Steer.WhlAng", "Car.SteerAngleFL", "Car.SteerAngleFR"
    ),
    _frame(
        "DamperCommand", 0x116, "commands of the dampers, held until this sample",
        *(command.name for command in COMMANDS),
    ),
)  # fmt: skip
FROM_SENSOR: Final = (
    _velocities("SuspVelocityFront", 0x120, "front", OUTPUTS[:2]),
    _velocities("SuspVelocityRear", 0x121, "rear", OUTPUTS[2:]),
    _deviations("SuspDeviation", 0x122),
)
FRAMES: Final = (CONTROL, STATUS, *TO_SENSOR, *FROM_SENSOR)
