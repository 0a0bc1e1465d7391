"""What the filter assumes of everything that its equations do not hold.

Two kinds of numbers: what the sensors do (`sensor.conditions`), and what the linear vehicle gets
wrong, which a coordinate search on recorded runs found (`docs/estimators.md`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.quantities import CORNERS
from sensor.channels import CHANNEL_NAMES
from sensor.conditions import PRODUCTION, Condition

Array = npt.NDArray[np.float64]

MEASURED: Final = tuple(name for name in CHANNEL_NAMES if "Steer" not in name)
"""What the filter reads, in this order: accelerations, rates, v_x, wheel speeds."""
WHEELS: Final = slice(7, 11)


@dataclass(frozen=True)
class Noise:
    """Standard deviations of the `measurement` (11,), white, and of the channels' slow `offsets`
    (11,) with their `times` (11,) [s], in the channels' units, a wheel speed's offset relative;
    `forces`: intensity of white noise on a state's rate, by the state's name; `drive` and `brake`:
    that of the pedal's and the front wheels' torque. `roughness` [m3] is Gd(n0) of the road and
    `coherence` the corner of left and right together [rad]; `rear` the share of the rear wheels'
    road, in variance, that the front wheels have not met.
    """

    measurement: Array
    offsets: Array
    times: Array
    forces: Mapping[str, float] = field(default_factory=dict)
    drive: float = 0.02
    brake: float = 0.2
    roughness: float = 64e-6  # ISO 8608, class B
    coherence: float = 2.5
    rear: float = 4e-4


_LINEAR_CAR_ERROR: Final = np.array([0.04, 0.018, 0.03, 7e-4, 5e-4, 3e-4, 1e-3, *4 * (0.1,)])
_LINEAR_CAR_DRIFT: Final = np.array([0.1, 0.1, 0.05, 2e-3, 2e-3, 2e-3, 1e-3, *4 * (1e-3,)])


def loosened(assumed: Noise) -> Noise:
    """Return the same for a car that speeds up, brakes or corners: longitudinal and lateral forces
    then make wheel speeds follow the wheel loads, which the linear vehicle knows nothing of.
    """
    measurement = np.hypot(assumed.measurement, _LINEAR_CAR_ERROR)
    offsets, times = np.hypot(assumed.offsets, _LINEAR_CAR_DRIFT), np.full(len(MEASURED), 5.0)
    forces = {**assumed.forces, "velocity.x": 1e-4, "velocity.y": 1e-3, "rate.z": 1e-4}
    return replace(
        assumed, measurement=measurement, offsets=offsets, times=times, forces=forces, drive=0.05,
        brake=1.0, rear=0.01,
    )  # fmt: skip


def noise(condition: Condition) -> Noise:
    """Return what the filter assumes under a measurement condition."""
    return _IDEAL if condition == "ideal" else _production()


def _forces() -> dict[str, float]:
    forces = {"velocity.x": 1e-5, "velocity.y": 1e-4, "velocity.z": 1e-5}
    forces |= {"rate.x": 1e-6, "rate.y": 1.5e-5, "rate.z": 4e-6}
    forces |= {f"travel_rate.{c}": 1e-4 for c in CORNERS}
    return forces | {f"spin.{c}": 1e-3 if c in CORNERS[:2] else 6e-4 for c in CORNERS}


_IDEAL: Final = Noise(
    measurement=np.array(
        [0.013, 0.018, 0.09, 1.2e-3, 1.7e-4, 1e-4, 3e-4, *2 * (6e-4,), *2 * (1e-3,)]
    ),
    offsets=np.array([0.03, 0.03, 0.08, 6e-4, 2e-4, 6e-4, 9e-4, *2 * (2e-5,), *2 * (1.4e-4,)]),
    times=np.array([*3 * (8.7,), *3 * (135.0,), *5 * (45.0,)]),
    forces=_forces(),
)


def least(condition: Condition) -> Noise:
    """Return what a bound assumes: a car that is as linear as the filter's model.

    Ideal channels have no noise but what the equation's solution needs: 1e-4 m/s2, 1e-6 rad/s, 1e-5
    m/s. Production sensors have theirs and nothing else.
    """
    white = np.array([*3 * (1e-4,), *3 * (1e-6,), *5 * (1e-5,)])
    slow = np.array([*3 * (1e-4,), *3 * (1e-6,), 1e-5, *4 * (1e-6,)])
    if condition == "production":
        sensed = _sensors()
        white, slow = np.hypot(white, sensed[0]), np.hypot(slow, sensed[1])
    calm = dict.fromkeys(_forces(), 1e-8)
    return Noise(white, slow, np.full(len(MEASURED), 30.0), calm, drive=1e-4, brake=1e-4)


def _sensors() -> tuple[Array, Array]:
    """Return what production sensors add, white and slow, as standard deviations (11,) each."""
    sensors = [PRODUCTION[CHANNEL_NAMES.index(name)] for name in MEASURED]
    white = np.array([np.hypot(s.noise, s.step / np.sqrt(12.0)) for s in sensors])
    slow = np.array([s.bias for s in sensors])
    slow[WHEELS.start - 1] = 0.02  # v_x, from wheels of unknown radius
    slow[WHEELS] = [s.scale for s in sensors[WHEELS]]
    return white, slow


def _production() -> Noise:
    white, offsets = _sensors()
    return Noise(
        measurement=np.hypot(white, _IDEAL.measurement),
        offsets=np.hypot(offsets, _IDEAL.offsets),
        times=np.full(11, 30.0),
        forces=_forces(),
    )
