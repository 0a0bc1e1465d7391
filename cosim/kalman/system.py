"""The filter's model: vehicle, road, drive, offsets and sensors as one discrete linear system.

The road's elevation rate is white noise (ISO 8608, waviness 2), shaped by the coherence of left and
right and averaged over the contact patch. It is held over `SUBSTEPS` parts of a sample; the rear
wheels meet what the front ones met a wheelbase ago.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from cosim.kalman.noise import MEASURED, WHEELS, Noise
from cosim.kalman.plant import GAS, OUTPUTS, STEER, Plant
from cosim.quantities import CORNERS
from sensor.channels import SAMPLE_RATE_HZ
from sensor.conditions import Condition

Array = npt.NDArray[np.float64]

SUBSTEPS: Final = 2
SAMPLE: Final = 1.0 / SAMPLE_RATE_HZ
STEP: Final = SAMPLE / SUBSTEPS
PATCH: Final = 0.11  # Road.PatchLength of the vehicle [m]
TRACK: Final = 1.625  # m
HEIGHT_LEAK: Final = 0.3  # 1/s: the common height of car and road cannot be seen
DRIVE_LEAK: Final = 0.2  # 1/s


@dataclass(frozen=True)
class System:
    """One substep x+ = F x + W w + B u + N f, white w of unit variance for (front sum, front
    difference, rear sum, rear difference), u the steering-wheel angle, f the dampers' force beyond
    the linear one; then x += process noise of covariance `Q` (n, n).

    After a whole sample y = H x + D u + noise of covariance `R`. At the beginning of a sample the
    states `moved[0]` are moved to the states `moved[1]` and cleared.
    """

    names: tuple[str, ...]
    F: Array
    W: Array
    B: Array
    N: Array
    Q: Array
    H: Array
    D: Array
    R: Array
    moved: tuple[tuple[int, ...], tuple[int, ...]]

    @property
    def rates(self) -> list[int]:
        """Where the four travel rates stand."""
        return [self.names.index(f"travel_rate.{c}") for c in CORNERS]


class _Builder:
    """A continuous system that grows state by state."""

    def __init__(self, plant: Plant, condition: Condition) -> None:
        model = plant.model
        if condition == "ideal":
            model = model.without_states(("imu", "imu_rate"))
        self.names = list(model.states)
        roads = [model.inputs.index(f"Road.zp.{c}") for c in CORNERS]
        self.A = model.A.copy()
        for c in CORNERS:
            i = self.names.index(f"Road.z.{c}")
            self.A[i, i] -= HEIGHT_LEAK
        self.roads, self.gas = model.B[:, roads], model.B[:, model.inputs.index(GAS)]
        self.steer = model.B[:, model.inputs.index(STEER)]
        rows = [OUTPUTS.index(name) for name in MEASURED]
        if condition == "production":
            rows[:6] = [OUTPUTS.index(name) for name in OUTPUTS[11:]]
        self.C, self.road_D = model.C[rows], model.D[np.ix_(rows, roads)]
        self.D = model.D[rows, model.inputs.index(STEER)]

    def add(self, names: Sequence[str], A: Array) -> list[int]:
        """Add states with their own dynamics `A`; return where they stand."""
        n, k = len(self.names), len(names)
        self.A = np.block([[self.A, np.zeros((n, k))], [np.zeros((k, n)), A]])
        self.C = np.hstack([self.C, np.zeros((len(self.C), k))])
        self.names += names
        return list(range(n, n + k))


def system(plant: Plant, condition: Condition, noise: Noise) -> System:
    """Return the filter's model at the plant's speed."""
    b = _Builder(plant, condition)
    vehicle = len(b.names)
    white = _add_road(b, plant.speed, noise)
    drive, brake = b.add(["drive", "brake"], -DRIVE_LEAK * np.eye(2))
    b.A[:vehicle, drive] = b.gas
    b.A[[b.names.index(f"spin.{c}") for c in CORNERS[:2]], brake] = 1.0
    offsets = b.add([f"offset.{name}" for name in MEASURED], -np.diag(1.0 / noise.times))
    share = np.ones(len(MEASURED))
    share[WHEELS] = plant.speed
    b.C[:, offsets] = np.diag(share)
    moved: tuple[tuple[int, ...], tuple[int, ...]] = ((), ())
    if condition == "production":
        moved = _add_teeth(b, plant.speed)
    n = len(b.names)
    intensity = np.zeros(n)
    intensity[[b.names.index(name) for name in noise.forces]] = list(noise.forces.values())
    intensity[[drive, brake]] = noise.drive, noise.brake
    intensity[offsets] = 2.0 * np.square(noise.offsets) / noise.times
    inputs = np.zeros((n, 4 + 1 + 4))
    inputs[: len(white), :4] = white
    inputs[:vehicle, 4] = b.steer
    inputs[:vehicle, 5:] = plant.force[[plant.model.states.index(s) for s in b.names[:vehicle]]]
    F, held = _held(b.A, inputs, STEP)
    Q = _diffused(b.A, np.diag(intensity), STEP)
    Q += _positive(
        _diffused(b.A, inputs[:, :4] @ inputs[:, :4].T, STEP) - held[:, :4] @ held[:, :4].T / STEP
    )
    return System(
        names=tuple(b.names), F=F, W=held[:, :4] / np.sqrt(STEP), B=held[:, 4], N=held[:, 5:], Q=Q,
        H=b.C, D=b.D, R=np.diag(np.square(noise.measurement)), moved=moved,
    )  # fmt: skip


def _add_road(b: _Builder, speed: float, noise: Noise) -> Array:
    """Add the states between white noise and elevation rate; return the white inputs' columns."""
    n = len(b.names)
    corner = noise.coherence * speed / TRACK
    shape = b.add(
        [f"road.{axle}.{k}" for axle in "FR" for k in ("sum", "difference")], -corner * np.eye(4)
    )
    w2 = 12.0 * (speed / PATCH) ** 2  # 1 / (1 + s t / 2 + s2 t2 / 12), t = PATCH / speed
    own = np.block(
        [[np.zeros((4, 4)), np.eye(4)], [-w2 * np.eye(4), -6.0 * speed / PATCH * np.eye(4)]]
    )
    patch = b.add([f"patch.{c}" for c in CORNERS] + [f"patch_rate.{c}" for c in CORNERS], own)
    mean, rate = patch[:4], patch[4:]
    b.A[:n, mean] = b.roads
    b.C[:, mean] = b.road_D
    amplitude = np.sqrt(0.5 * (2.0 * np.pi * 0.1) ** 2 * noise.roughness * speed)
    inputs = np.zeros((len(b.names), 4))
    half = np.sqrt(0.5)
    mix = np.kron(np.eye(2), half * np.array([[1.0, 1.0], [1.0, -1.0]]))  # wheels by (sum, diff)
    # sum: (s + sqrt(2) c) / (s + c); difference: s / (s + c): powers 1 + and 1 - coherence
    back = np.array([np.sqrt(2.0) - 1.0, -1.0, np.sqrt(2.0) - 1.0, -1.0]) * corner
    inputs[shape] = amplitude * np.eye(4)
    inputs[rate] = w2 * amplitude * mix
    b.A[np.ix_(rate, shape)] = w2 * mix * back
    return inputs


def _add_teeth(b: _Builder, speed: float) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Let the wheel speeds be means over a sample and a sample old, v_x the mean of them."""
    k = len(MEASURED[WHEELS])
    mean = b.add([f"turned.{c}" for c in CORNERS], np.zeros((k, k)))
    before = b.add([f"turned_before.{c}" for c in CORNERS], np.zeros((k, k)))
    b.A[mean] = b.C[WHEELS] / SAMPLE
    offsets = [b.names.index(f"offset.{name}") for name in MEASURED[WHEELS]]
    b.A[np.ix_(mean, offsets)] = 0.0
    b.C[WHEELS] = 0.0
    b.C[WHEELS, before] = np.eye(k)
    b.C[WHEELS, offsets] = speed * np.eye(k)
    own = b.names.index("offset.Car.vx")
    b.C[6] = 0.0
    b.C[6, before] = 1.0 / k
    b.C[6, own] = 1.0
    return tuple(mean), tuple(before)


def _held(A: Array, B: Array, h: float) -> tuple[Array, Array]:
    n, m = B.shape
    whole = np.zeros((n + m, n + m))
    whole[:n, :n], whole[:n, n:] = A, B
    grown = expm(whole * h)
    return np.asarray(grown[:n, :n]), np.asarray(grown[:n, n:])


def _diffused(A: Array, intensity: Array, h: float) -> Array:
    """Covariance that white noise of this intensity leaves after h [s] (Van Loan)."""
    n = len(A)
    whole = np.block([[-A, intensity], [np.zeros((n, n)), A.T]])
    grown = expm(whole * h)
    Q = grown[n:, n:].T @ grown[:n, n:]
    return np.asarray(0.5 * (Q + Q.T))


def _positive(Q: Array) -> Array:
    value, vector = np.linalg.eigh(0.5 * (Q + Q.T))
    return np.asarray((vector * np.maximum(value, 0.0)) @ vector.T)
