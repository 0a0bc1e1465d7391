"""How well the signals are measured: the parameters of the vehicle FMU's own sensor stage."""

from __future__ import annotations

from collections.abc import Mapping
from math import radians
from typing import Final

# The inertial sensor's low-pass is that of the Bosch SMI240, made for chassis control units: 50 Hz
# (or 400 Hz, which 100 samples a second cannot carry). It sits on the tunnel, 0.2 m ahead of the
# centre of gravity and 0.1 m below it, turned by half a degree about each axis, which is what
# fixing it allows. The rings of most cars' wheel-speed sensors have 48 teeth.
PRODUCTION_PARAMETERS: Final[Mapping[str, float]] = {
    "Sensor.Imu.Cutoff": 50.0,
    "Sensor.Imu.X": 0.2,
    "Sensor.Imu.Y": 0.02,
    "Sensor.Imu.Z": -0.1,
    "Sensor.Imu.Roll": radians(0.5),
    "Sensor.Imu.Pitch": radians(-0.5),
    "Sensor.Imu.Yaw": radians(0.5),
    "Sensor.WheelSpd.Teeth": 48.0,
}
