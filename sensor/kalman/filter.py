"""The Kalman filter at run time: constant gains on a grid of speeds, dampers and delay line exact.

The state is what the linear vehicle deviates by from going straight on at a speed, which follows
the measured v_x in small steps. Front wheel speeds are taken along the car (divided by what the
steering makes of them). The dampers' curves enter as known forces, computed from the estimate; the
road which the front wheels have met acts on the rear ones a wheelbase later.
"""

from math import cos
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNEL_NAMES, CHANNELS, OUTPUTS, SAMPLE_RATE_HZ
from sensor.estimator import sample_by_sample
from sensor.kalman.damper import Dampers
from sensor.kalman.delay import DelayLine
from sensor.kalman.model import SETS, AtSpeed, Gains, KalmanModel
from sensor.window import check_sample

Array = npt.NDArray[np.float64]

_VX = CHANNEL_NAMES.index("Car.vx")
_AX, _AY = CHANNEL_NAMES.index("Car.ax"), CHANNEL_NAMES.index("Car.ay")
_STEER = CHANNEL_NAMES.index("Steer.WhlAng")
_FRONT = tuple(
    (CHANNEL_NAMES.index(f"Car.v{wheel}"), CHANNEL_NAMES.index(f"Car.SteerAngle{wheel}"))
    for wheel in ("FL", "FR")
)
FOLLOW: Final = 0.1  # share of a speed's change that the operating point takes on per sample
STRIDE: Final = 0.05  # m/s that it moves at least
LEVEL_SHARE: Final = 0.02  # of the newest sample in the innovations' level: half a second
NEWEST: Final = 0.3  # share of a new sample in the accelerations that tell of tyre forces
ATTACK, RELEASE = 0.5, 0.02  # and how fast they count, how slowly they are forgotten
NEWTON: Final = 2  # steps to the dampers' velocities
LEAST_LEVEL: Final = 1e-4
LARGEST: Final = 8.0  # m/s: no suspension moves so fast; a filter that says so starts anew


class TyreForces:
    """How far the tyres' horizontal forces take the car from the linear one: 0 to 1, from the
    accelerations, low-passed, and the wheel loads' share they stand for.
    """

    def __init__(self, none: float = 0.5, full: float = 1.5) -> None:
        self._none, self._full = none, full
        self.reset()

    def reset(self) -> None:
        """Forget all samples."""
        self._ax: float | None = None
        self._ay, self._size = 0.0, 0.0

    def share(self, measured: Array) -> float:
        """Take a sample (14,) and return the share."""
        ax, ay = float(measured[_AX]), float(measured[_AY])
        if self._ax is None:
            self._ax, self._ay, self._size = ax, ay, (ax**2 + ay**2) ** 0.5
        self._ax += NEWEST * (ax - self._ax)
        self._ay += NEWEST * (ay - self._ay)
        size = (self._ax**2 + self._ay**2) ** 0.5
        self._size += (ATTACK if size > self._size else RELEASE) * (size - self._size)
        return min(max((self._size - self._none) / (self._full - self._none), 0.0), 1.0)


class KalmanFilter:
    """Estimates the suspension velocities, valid from the first sample; `model` is written by
    `cosim sensor kalman`.

    `deviation` is that of the filter's own covariance, times the level of the innovations: a road
    rougher than the one the filter was made for makes both larger.
    """

    def __init__(self, model: KalmanModel) -> None:
        self.model = model
        self.at = AtSpeed(model)
        self._dampers = Dampers()
        self._forces = TyreForces()
        self.line = DelayLine(model.taps, model.wheelbase) if model.taps else None
        length = model.parts[f"{SETS[0]}K_taps"].shape[2]
        self._moved = model.moved_slices()
        self._span = 1.0 / (SAMPLE_RATE_HZ * model.substeps)
        self._allocate(len(model.parts["rest"][0]), len(model.rows), length)
        self.estimate = np.full(len(OUTPUTS), np.nan)
        self.deviation = np.full(len(OUTPUTS), np.nan)
        self.reset()

    @classmethod
    def load(cls, path: str | Path) -> "KalmanFilter":
        """Read a filter; raises SensorError as `KalmanModel.load` does."""
        return cls(KalmanModel.load(path))

    def _allocate(self, n: int, p: int, length: int) -> None:
        self._x, self._next, self._add = np.zeros(n), np.zeros(n), np.zeros(n)
        self._taps = np.zeros((2, length))
        self._read, self.innovation, self._expected = (
            np.zeros(len(CHANNELS)),
            np.zeros(p),
            np.zeros(p),
        )
        self._force = np.zeros(4)

    def reset(self) -> None:
        """Forget all samples."""
        self._started = False
        self._x.fill(0.0)
        self._dampers.reset()
        if self.line is not None:
            self.line.reset()
        self._forces.reset()
        self.level = 1.0
        self.gains: list[tuple[Gains, float]] = []
        self.estimate.fill(np.nan)
        self.deviation.fill(np.nan)

    def step(self, measured: Array, command: Array) -> bool:
        """Take one sample (14,) in SI units and the command (4,) held until it; update `estimate`.

        Raises SensorError naming a channel that is NaN or infinite.
        """
        check_sample(measured)
        speed = abs(float(measured[_VX]))
        if not self._started:
            self._speed = self.at_speed = speed
            self.at.set(speed)
        else:
            self.predict(float(measured[_STEER]), command)
            self._follow(speed)
        self.correct(measured, command)
        self._started = True
        np.negative(self._x.take(self.model.rates, out=self._force, mode="clip"), out=self.estimate)
        if not -LARGEST < self.estimate.min() <= self.estimate.max() < LARGEST:
            self.reset()
            return False
        self.deviation.fill(0.0)
        for gains, share in self.gains:
            np.multiply(
                gains.deviation, share * self.level * self.model.calibration, out=self._force
            )
            self.deviation += self._force
        return True

    def predict(self, steer: float, command: Array) -> None:
        """Go on by one sample; the damper command (4,) and the steering-wheel angle are held."""
        at, x = self.at, self._x
        if self._moved is not None:
            before, after = self._moved
            x[after] = x[before]
            x[before] = 0.0
        self._dampers.set(command)
        for _ in range(self.model.substeps):
            early = self._x.take(self.model.rates, out=self._force, mode="clip").tolist()
            np.matmul(at.F, self._x, out=self._next)
            np.multiply(at.steer, steer, out=self._add)
            self._next += self._add
            if self.line is not None:
                np.matmul(at.rear, self.meet(self.line), out=self._add)
                self._next += self._add
            late = self._next.take(self.model.rates, out=self._force, mode="clip").tolist()
            self.add_forces([-0.5 * (a + b) for a, b in zip(early, late, strict=True)])
            self._x, self._next = self._next, self._x

    def add_forces(self, extension: list[float]) -> None:
        """Add what the dampers' forces are beyond those of the linear system.

        `extension` (4,) [m/s] is in the middle of the substep without them. A hard damper changes
        it within less than a substep, so each wheel's middle is solved for (implicit
        midpoint rule).
        """
        at = self.at
        for wheel, free in enumerate(extension):
            linear = float(at.damping[wheel])
            half = 0.5 * float(at.damper[self.model.rates[wheel], wheel])  # m/s per N
            v = free
            for _ in range(NEWTON):
                force, slope = self._dampers.force(wheel, v)
                v -= (v + half * (force - linear * v) - free) / (1.0 + half * (slope - linear))
            force, _ = self._dampers.force(wheel, v)
            self._force[wheel] = force - linear * v
        self.add_force()

    def add_force(self) -> None:
        """Add the forces (4,) that have been computed."""
        np.matmul(self.at.damper, self._force, out=self._add)
        self._next += self._add

    def meet(self, line: DelayLine) -> Array:
        """Return the road (2,) that the rear wheels meet in one substep."""
        return line.step(self._speed * self._span)

    def _follow(self, speed: float) -> None:
        """Move the operating point: the same motion, seen from another speed."""
        self._speed += FOLLOW * (speed - self._speed)
        if abs(self._speed - self.at_speed) < STRIDE:
            return
        self._x += self.at.rest
        self.at.set(self._speed)
        self._x -= self.at.rest
        self.at_speed = self._speed

    def correct(self, measured: Array, command: Array) -> None:
        """Take in the sample."""
        at, e = self.at, self.innovation
        self._read[:] = measured
        for wheel, angle in _FRONT:
            self._read[wheel] *= cos(measured[angle])
        self._read.take(self.model.rows, out=e, mode="clip")
        np.matmul(at.H, self._x, out=self._expected)
        e -= self._expected
        e -= at.still
        np.multiply(at.D, measured[_STEER], out=self._expected)
        e -= self._expected
        if not self._started:
            self._x[self.model.offsets] += self.model.first * e
            e *= 1.0 - self.model.first
        np.clip(e, -self.model.limits, self.model.limits, out=e)
        if not self._started:
            self._dampers.set(command)
        self.shares = self._dampers.valve, self._forces.share(measured)
        self.gains = at.gains(*self.shares)
        square = 0.0
        for gains, share in self.gains:
            square += share * self._add_to_state(gains, share)
        self.level = max(
            LEAST_LEVEL, (self.level**2 + LEVEL_SHARE * (square - self.level**2)) ** 0.5
        )

    def _add_to_state(self, gains: Gains, share: float) -> float:
        """Add a share of the correction; return the innovations' mean square, 1 as predicted."""
        e = self.innovation
        np.matmul(gains.K, e, out=self._add)
        self._add *= share
        self._x += self._add
        if self.line is not None:
            np.matmul(gains.K_taps, e, out=self._taps)
            self._taps *= share
            newest = self.line.taps[:, : self._taps.shape[1]]
            newest += self._taps
        np.matmul(gains.information, e, out=self._expected)
        return float(self._expected @ e) / len(e)

    def apply(
        self, channels: npt.NDArray[np.floating[Any]], commands: npt.NDArray[np.floating[Any]]
    ) -> Array:
        """Estimate a whole run from a fresh start: (samples, 14) -> (samples, 4) [m/s]."""
        return self.apply_with_deviation(channels, commands)[0]

    def apply_with_deviation(
        self, channels: npt.NDArray[np.floating[Any]], commands: npt.NDArray[np.floating[Any]]
    ) -> tuple[Array, Array]:
        """Return estimates and predicted deviations of a whole run, (samples, 4) [m/s] each."""
        return sample_by_sample(KalmanFilter(self.model), channels, commands)
