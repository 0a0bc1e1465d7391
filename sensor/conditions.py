"""Measurement conditions: what lies between vehicle and estimators, `ideal` or `production`.

`ideal` is the paper's: the 14 channels untouched. `production` is what a car's sensors deliver. Its
first half lies in the vehicle FMU (`PRODUCTION_PARAMETERS`): an IMU away from the centre of
gravity, misaligned and behind its low-pass, wheel speeds from the times of the teeth, v_x from the
wheel speeds. Its second half is here: latency, scale error, bias, white noise and steps, in this
order.

Each number has its source, a data sheet or a public message catalogue; [A] marks an assumption.
- [SMI700] Bosch, SMI700 product information sheet: an inertial sensor for ESC and active damping.
- [BMI055] Bosch, BMI055: noise density of a MEMS accelerometer of the same make and age.
- [SMI240] Bosch, SMI240, made for chassis control units: low-pass at 50 or 400 Hz.
- [LWS] Bosch Motorsport, steering-wheel angle sensor LWS: 0.1 deg steps, 100 messages a second.
- [opendbc] github.com/commaai/opendbc, hyundai_kia_generic.dbc, message WHL_SPD11: wheel speeds in
  steps of 1/32 km/h; vw_mqb: messages ESP_19 and LWI_01, 100 a second.
- [R30] UN Regulation No. 30, 6.1.4 and 6.1.5: tyre diameters within 0.97 to 1.04 of the section
  height, -1.1 to +1.5 % of the diameter for a 235/60 R18.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from typing import Any, Final, Literal, get_args

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNEL_NAMES, STAGED, stage_channels
from sensor.errors import SensorError

Array = npt.NDArray[np.float64]
Condition = Literal["ideal", "production"]
CONDITIONS: Final[tuple[Condition, ...]] = get_args(Condition)

_G = 9.81  # m/s2
_KMH = 1.0 / 3.6  # m/s


@dataclass(frozen=True)
class Imperfection:
    """What a sensor adds to its signal; `noise`, `bias` and `step` in the channel's unit.

    `noise` is the standard deviation of white noise, `bias` and `scale` (ratio) those of an offset
    and a gain that are drawn once per run, `step` the size of a digital step and `latency` a number
    of whole samples.
    """

    noise: float
    bias: float
    scale: float
    step: float
    latency: int


# Where a sheet gives limits, the standard deviation is a third of them.
ACCELERATION: Final = Imperfection(
    noise=0.03,  # 3 mg: between [SMI700]'s 6 mg rms and [BMI055]'s 150 ug/sqrt(Hz), 1.1 mg in 50 Hz
    bias=0.050 * _G / 3.0,  # [SMI700] +-50 mg over temperature and life
    scale=0.03 / 3.0,  # [SMI700] +-3 %
    step=_G / 5000.0,  # [SMI700] 5000 steps per g
    latency=0,  # [A] in the control unit itself, read at every sample
)
ANGULAR_RATE: Final = Imperfection(
    noise=radians(0.1),  # [SMI700] 0.1 deg/s rms
    bias=radians(3.0) / 3.0,  # [SMI700] +-3 deg/s over temperature and life
    scale=0.03 / 3.0,  # [SMI700] +-3 %
    step=radians(0.01),  # [SMI700] 100 steps per deg/s
    latency=0,  # [A] as the accelerations
)
WHEEL_SPEED: Final = Imperfection(
    noise=0.01,  # [A] a tooth's place known to 0.15 % of the pitch at 50 km/h
    bias=0.0,  # counted, so none
    scale=0.015 / 3.0,  # [R30] rolling radius of each tyre, +-1.5 %
    step=_KMH / 32.0,  # [opendbc] 1/32 km/h, coarser than 1/128 m/s
    latency=1,  # [opendbc] 100 messages a second, the newest one up to a sample old
)
SPEED: Final = Imperfection(
    noise=0.02,  # [A] the brake controller's reference speed, beside its wheels' own noise
    bias=0.0,  # from the wheel speeds
    scale=0.0,  # that of the wheels, which share it: see `Measurement`
    step=_KMH / 32.0,  # [opendbc] as the wheel speeds
    latency=1,  # [opendbc] as the wheel speeds
)
STEERING_WHEEL: Final = Imperfection(
    noise=radians(0.1),  # [A] one step of the sensor
    bias=radians(1.5) / 3.0,  # [A] straight ahead is set to +-1.5 deg at the wheel alignment
    scale=0.0,  # teeth and magnets: counted, so none
    step=radians(0.1),  # [LWS]
    latency=1,  # [LWS] 100 messages a second
)
STEER_RATIO: Final = 16.5  # of the vehicle FMU (Steer.Ratio): road wheels are told from the rack
ROAD_WHEEL: Final = Imperfection(
    noise=STEERING_WHEEL.noise / STEER_RATIO,
    bias=STEERING_WHEEL.bias / STEER_RATIO,
    scale=STEERING_WHEEL.scale,
    step=STEERING_WHEEL.step / STEER_RATIO,
    latency=STEERING_WHEEL.latency,
)

PRODUCTION: Final[tuple[Imperfection, ...]] = (
    *3 * (ACCELERATION,),
    *3 * (ANGULAR_RATE,),
    SPEED,
    *2 * (ROAD_WHEEL,),
    *4 * (WHEEL_SPEED,),
    STEERING_WHEEL,
)

PRODUCTION_PARAMETERS: Final[Mapping[str, float]] = {
    "Sensor.Imu.Cutoff": 50.0,  # Hz; [SMI240], the one that 100 samples a second can carry
    "Sensor.Imu.X": 0.2,  # m; [A] on the tunnel, ahead of the centre of gravity and below it
    "Sensor.Imu.Y": 0.02,  # m; [A]
    "Sensor.Imu.Z": -0.1,  # m; [A]
    "Sensor.Imu.Roll": radians(0.5),  # [A] half a degree about each axis, which fixing it allows
    "Sensor.Imu.Pitch": radians(-0.5),  # [A]
    "Sensor.Imu.Yaw": radians(0.5),  # [A]
    "Sensor.WheelSpd.Teeth": 48.0,  # the rings of most cars
}
"""Start values of the vehicle FMU, in its units; they do not touch the ideal channels."""

_STAGED = np.array(STAGED)
_VX = CHANNEL_NAMES.index("Car.vx")
_WHEELS = slice(CHANNEL_NAMES.index("Car.vFL"), CHANNEL_NAMES.index("Car.vRR") + 1)
_SALT = 0x5E4508  # keeps these draws apart from others of the same seed


class Measurement:
    """The 14 channels as a car measures them, from ideal channels and the FMU's sensor stage.

    `condition` is one of `CONDITIONS`; the same `seed` gives the same bits, sample by sample or a
    run at once. Offsets and gains are drawn once and stay after `reset`. Raises SensorError for an
    unknown condition.
    """

    def __init__(self, condition: str, seed: int) -> None:
        if condition not in CONDITIONS:
            known = " or ".join(CONDITIONS)
            raise SensorError(f"there is no measurement condition {condition!r}; it is {known}.")
        self._ideal = condition == "ideal"
        self._seed = seed
        self.gain, self.bias = _drawn(seed)
        self._noise = np.array([p.noise for p in PRODUCTION])
        self._step = np.array([p.step for p in PRODUCTION])
        self._latency = np.array([p.latency for p in PRODUCTION])
        self._allocate()
        self.reset()

    def _allocate(self) -> None:
        width, depth = len(PRODUCTION), int(self._latency.max()) + 1
        self._past = np.zeros(depth * width)  # newest sample last
        self._newest = self._past[-width:]
        self._taken = (depth - 1 - self._latency) * width + np.arange(width)
        self._draw = np.zeros(width)
        self._measured = np.zeros(width)

    def reset(self) -> None:
        """Begin the run again: the same noise from its first sample on."""
        self._random = _noise_source(self._seed)
        self._started = False

    def step(self, channels: Array, stage: Array) -> Array:
        """Take the channels (14,) and the sensor stage (11,) of one sample, SI units; return what
        is measured (14,), the same array every time (`channels` itself in condition ideal).
        """
        if self._ideal:
            return channels
        width, measured = len(self._measured), self._measured
        # One-dimensional and towards lower addresses: numpy then needs no temporary copy.
        self._past[:-width] = self._past[width:]
        self._newest[:] = channels
        self._newest[_STAGED] = stage
        if not self._started:
            self._past.reshape(-1, width)[:] = self._newest  # nothing has changed before the start
            self._started = True
        self._past.take(self._taken, out=measured, mode="clip")
        measured *= self.gain
        measured += self.bias
        self._random.standard_normal(out=self._draw)
        self._draw *= self._noise
        measured += self._draw
        measured /= self._step
        np.rint(measured, out=measured)
        measured *= self._step
        return measured

    def apply(
        self, channels: npt.NDArray[np.floating[Any]], stage: npt.NDArray[np.floating[Any]]
    ) -> Array:
        """Return a whole run as measured, (samples, 14), from channels (samples, 14) and sensor
        stage (samples, 11): what `step` gives from a fresh start, whose state is untouched.
        """
        if self._ideal:
            return np.array(channels, dtype=np.float64)
        staged = np.asarray(stage_channels(channels, stage), dtype=np.float64)
        now = np.arange(len(staged))[:, np.newaxis]
        measured = np.take_along_axis(staged, np.maximum(now - self._latency, 0), axis=0)
        measured *= self.gain
        measured += self.bias
        measured += _noise_source(self._seed).standard_normal(measured.shape) * self._noise
        measured /= self._step
        np.rint(measured, out=measured)
        measured *= self._step
        return measured


def _drawn(seed: int) -> tuple[Array, Array]:
    """Return the gains and offsets of a run, (14,) each; v_x, the mean of two wheels, has the mean
    gain of all four.
    """
    random = np.random.default_rng([_SALT, seed, 0])
    gain = 1.0 + random.standard_normal(len(PRODUCTION)) * [p.scale for p in PRODUCTION]
    bias = random.standard_normal(len(PRODUCTION)) * [p.bias for p in PRODUCTION]
    gain[_VX] = gain[_WHEELS].mean()
    return gain, bias


def _noise_source(seed: int) -> np.random.Generator:
    return np.random.default_rng([_SALT, seed, 1])
