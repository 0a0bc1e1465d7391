"""The fixed-interval smoother: what could be known of a sample once the whole run is known.

The filter runs forward; then the innovations that came later run back through the same model
(modified Bryson-Frazier form of Rauch, Tung and Striebel's smoother; Bierman, Factorization Methods
for Discrete Sequential Estimation, 1977, ch. X). It needs no inverse of the state's covariance, and
of that covariance only the four lines of the suspension velocities. Not an estimator of the loop,
and made for dampers near the passive setting: the way back knows the linear damping only.
"""

from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from sensor.channels import OUTPUTS
from sensor.kalman.delay import DelayLine
from sensor.kalman.filter import KalmanFilter
from sensor.kalman.model import AtSpeed, Gains, KalmanModel

Array = npt.NDArray[np.float64]


PASSES: Final = 2  # the second one has the dampers' forces from the first one's velocities


class _Taken(NamedTuple):
    """What the filter did with one sample."""

    speed: float
    shares: tuple[float, float]
    innovation: Array
    met: tuple[tuple[int, float], ...]


class _Remembering(KalmanFilter):
    """A filter that remembers what each substep did, and takes the dampers' velocities from
    estimates (samples, 4) made before, if there are any.
    """

    def __init__(self, model: KalmanModel, known: Array | None) -> None:
        super().__init__(model)
        self._known, self._sample = known, 0
        self._met: list[tuple[int, float]] = []
        self._substep = 0

    def take(self, k: int, measured: Array, command: Array) -> _Taken:
        """Take sample `k`."""
        self._sample, self._substep = k, 0
        self._met = []
        self.step(measured, command)
        return _Taken(self.at_speed, self.shares, self.innovation.copy(), tuple(self._met))

    def meet(self, line: DelayLine) -> Array:
        """Remember which taps the rear wheels meet."""
        road = super().meet(line)
        self._met.append((line.age, line.part))
        return road

    def add_forces(self, extension: list[float]) -> None:
        """Take the velocity in the middle of the substep from what is known."""
        if self._known is None:
            super().add_forces(extension)
            return
        before, after = self._known[self._sample - 1 : self._sample + 1]
        share = (self._substep + 0.5) / self.model.substeps
        self._substep += 1
        for wheel, v in enumerate(((1.0 - share) * before + share * after).tolist()):
            force, _ = self._dampers.force(wheel, v)
            self._force[wheel] = force - self.at.damping[wheel] * v
        self.add_force()


class Smoother:
    """Smooths whole runs with the model of a Kalman filter."""

    def __init__(self, model: KalmanModel) -> None:
        self.model = model

    @classmethod
    def load(cls, path: str | Path) -> "Smoother":
        """Read the filter's model; raises SensorError as `KalmanModel.load` does."""
        return cls(KalmanModel.load(path))

    def apply(
        self, channels: npt.NDArray[np.floating[Any]], commands: npt.NDArray[np.floating[Any]]
    ) -> Array:
        """Estimate a whole run: channels (samples, 14) and commands (samples, 4), each held until
        its sample -> (samples, 4) [m/s].
        """
        result: Array | None = None
        for _ in range(PASSES):
            result = self._backward(*self._forward(channels, commands, result))
        return np.asarray(result)

    def _forward(
        self,
        channels: npt.NDArray[np.floating[Any]],
        commands: npt.NDArray[np.floating[Any]],
        known: Array | None,
    ) -> tuple[list[_Taken], Array]:
        kalman = _Remembering(self.model, known)
        estimates = np.empty((len(channels), len(OUTPUTS)))
        held, taken = np.asarray(commands, dtype=np.float64), []
        for k, sample in enumerate(np.asarray(channels, dtype=np.float64)):
            taken.append(kalman.take(k, sample, held[k]))
            estimates[k] = kalman.estimate
        return taken, estimates

    def _backward(self, taken: list[_Taken], estimates: Array) -> Array:
        at = AtSpeed(self.model)
        result = estimates.copy()
        x = np.zeros(len(at.rest))
        taps = np.zeros((2, self.model.taps))
        for k in range(len(taken) - 1, -1, -1):
            sample = taken[k]
            at.set(sample.speed)
            gains = at.gains(*sample.shares)
            for g, share in gains:
                result[k] -= share * (
                    g.P @ x + np.tensordot(g.P_taps, taps[:, : g.P_taps.shape[2]])
                )
            x = x - at.H.T @ _back(gains, x, taps, sample.innovation)
            if k:
                x, taps = self._before(at, sample, x, taps)
        return result

    def _before(self, at: AtSpeed, sample: _Taken, x: Array, taps: Array) -> tuple[Array, Array]:
        """Take the sensitivity to a sample's state back to the state after the sample before."""
        for substep in range(self.model.substeps - 1, -1, -1):
            if sample.met:
                _unmeet(taps, *sample.met[substep], at.rear.T @ x)
            x = at.F.T @ x
        moved = self.model.moved_slices()
        if moved is not None:
            before, after = moved
            x[before] = x[after]
            x[after] = 0.0
        return x, taps


def _unmeet(taps: Array, age: int, part: float, met: Array) -> None:
    """Move the sensitivity to the taps (2, m) back by a substep whose road was met (2,)."""
    taps[:, :-1] = taps[:, 1:].copy()
    taps[:, -1] = 0.0
    if age < taps.shape[1] - 1:
        taps[:, age] += (1.0 - part) * met
        taps[:, age + 1] += part * met


def _back(gains: list[tuple[Gains, float]], x: Array, taps: Array, innovation: Array) -> Array:
    """Return what a sample's channels (p,) mean for all that comes after it."""
    total = np.zeros(len(innovation))
    for g, share in gains:
        newest = taps[:, : g.K_taps.shape[1]]
        later = g.K.T @ x + np.tensordot(newest, g.K_taps) + g.information @ innovation
        total += share * later
    return total
