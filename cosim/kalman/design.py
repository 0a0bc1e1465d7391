"""From the vehicle FMU to the filters' files: one for each variant and measurement condition."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.fmi import Description
from cosim.kalman.noise import MEASURED, WHEELS, Noise, loosened, noise
from cosim.kalman.plant import Plant, damped, plant
from cosim.kalman.riccati import Sampled, Stationary, sampled, smoothed_covariance, stationary
from cosim.kalman.system import STEP, SUBSTEPS, System, system
from cosim.vehicle import builtin_fmu
from sensor.body_motion import Geometry
from sensor.channels import CHANNEL_NAMES
from sensor.conditions import CONDITIONS, Condition
from sensor.kalman.damper import equivalent_damping
from sensor.kalman.model import DAMPERS, DRIVING, PARTS, SETS, KalmanModel

Array = npt.NDArray[np.float64]

SPEEDS: Final = (1.0, 1.5, 2.2, 3.6, 4.5, 6.5, 9.5, 14.0, 20.0, 28.0, 40.0)  # m/s
SLOWEST_DELAY: Final = 4.5  # m/s: below it the delay line would be longer than it is worth
DAMPING_FROM: Final = 0.057  # m/s, the suspension velocity's deviation on class B at 50 km/h
WHEELBASE: Final = Geometry().front_x - Geometry().rear_x
CORRECTED: Final = 40  # taps, 0.2 s: what is older is known as well as it will ever be
THIN: Final = 1e-5
# measured over predicted deviation, straight training runs with passive dampers; with wheel speeds
CALIBRATION: Final[Mapping[tuple[Condition, bool], float]] = {
    ("ideal", False): 1.35,
    ("ideal", True): 1.1,
    ("production", False): 1.5,
    ("production", True): 1.6,
}
WHEEL_LIMIT: Final = 0.25  # m/s: a spinning or locking wheel tells nothing of its suspension


@dataclass(frozen=True)
class Variant:
    """What a filter uses beside the IMU and v_x: wheel speeds, wheelbase delay."""

    wheels: bool
    delay: bool

    @property
    def rows(self) -> list[int]:
        """The channels it reads, among `MEASURED`."""
        return list(range(WHEELS.stop if self.wheels else WHEELS.start))

    def substeps_behind(self, speed: float) -> float | None:
        """Return the rear wheels' delay in substeps, None where the filter does without."""
        return WHEELBASE / (speed * STEP) if self.delay and speed >= SLOWEST_DELAY else None


VARIANTS: Final[Mapping[str, Variant]] = {
    "kalman_imu": Variant(wheels=False, delay=False),
    "kalman_wheels": Variant(wheels=True, delay=False),
    "kalman_delay": Variant(wheels=False, delay=True),
    "kalman": Variant(wheels=True, delay=True),
}


@dataclass(frozen=True)
class Design:
    """A filter at one speed."""

    plant: Plant
    system: System
    sampled: Sampled
    filter: Stationary
    rows: Sequence[int]

    def deviation(self) -> Array:
        """Return the standard deviation of the four estimates [m/s]."""
        rates = self.system.rates
        return np.sqrt(np.diag(self.filter.P)[rates])

    def smoothed_deviation(self) -> Array:
        """Return the same of the fixed-interval smoother [m/s]."""
        covariance = smoothed_covariance(self.sampled, self.filter)
        return np.sqrt(np.diag(covariance)[self.system.rates])


def plants(speeds: Sequence[float]) -> list[Plant]:
    """Linearise the built-in vehicle at these speeds [m/s]; raises `FmuError`."""
    description = Description(builtin_fmu())
    damping = equivalent_damping(DAMPING_FROM)
    return [plant(description, speed, damping) for speed in speeds]


def design(at: Plant, variant: Variant, condition: Condition, assumed: Noise) -> Design:
    """Return the variant's filter at the plant's speed."""
    model = system(at, condition, assumed)
    joined = sampled(model, variant.rows, variant.substeps_behind(at.speed), assumed.rear)
    return Design(at, model, joined, stationary(joined), variant.rows)


def kalman_model(
    all_plants: Sequence[Plant],
    variant: Variant,
    condition: Condition,
    assumed: Noise | None = None,
) -> KalmanModel:
    """Return the numbers of a variant's filter at the plants' speeds."""
    assumed = assumed or noise(condition)
    designs = [design(at, variant, condition, assumed) for at in all_plants]
    taps = max((len(d.sampled.A) - d.sampled.size) // 2 for d in designs)
    driving = {"tight": assumed, "loose": loosened(assumed)}
    each = [_model_parts(d) for d in designs]
    for prefix, (kind, damper) in zip(SETS, itertools.product(DRIVING, DAMPERS), strict=True):
        damping = equivalent_damping(DAMPING_FROM, damper)
        for parts, at in zip(each, all_plants, strict=True):
            d = design(damped(at, damping), variant, condition, driving[kind])
            parts |= {
                f"{prefix}{name}": part for name, part in _gains(d, min(taps, CORRECTED)).items()
            }
    s = designs[0].system
    rows = variant.rows
    at_limit = np.full(len(rows), 1e3)
    at_limit[WHEELS.start :] = WHEEL_LIMIT
    spread = np.square(assumed.offsets[rows])
    spread[WHEELS.start :] *= 20.0**2
    return KalmanModel(
        speeds=np.array([at.speed for at in all_plants]),
        parts={name: np.stack([parts[name] for parts in each]) for name in PARTS},
        rows=np.array([CHANNEL_NAMES.index(MEASURED[i]) for i in rows]),
        rates=np.array(s.rates),
        offsets=np.array([s.names.index(f"offset.{MEASURED[i]}") for i in rows]),
        first=spread / (spread + np.diag(designs[-1].filter.S)),
        moved=np.array(s.moved, dtype=np.int64),
        limits=at_limit,
        calibration=CALIBRATION[condition, variant.wheels],
        wheelbase=WHEELBASE,
        substeps=SUBSTEPS,
        taps=taps + 1 if taps else 0,
        about={"states": s.names, "condition": condition, "roughness": assumed.roughness},
    )


def _model_parts(d: Design) -> dict[str, Array]:
    """Return the model's arrays of `PARTS` at one speed."""
    s, rows = d.system, list(d.rows)
    known = dict(zip(d.plant.model.states, d.plant.rest, strict=True))
    delayed = len(d.sampled.A) > d.sampled.size
    return {
        "still": d.plant.still[: len(MEASURED)][rows],
        "rest": np.array([known.get(name, 0.0) for name in s.names]),
        "H": s.H[rows],
        "D": s.D[rows],
        "F": _thinned(s.F, np.sqrt(np.diag(d.filter.X)[: d.sampled.size])),
        "rear": s.W[:, 2:] * delayed,
        "steer": s.B,
        "damper": s.N,
        "damping": d.plant.damping,
    }


def _thinned(F: Array, size: Array) -> Array:
    """Return F without the couplings that move no state by `THIN` of its own uncertainty."""
    return np.where(np.abs(F) * size > THIN * size[:, np.newaxis], F, 0.0)


def _gains(d: Design, taps: int) -> dict[str, Array]:
    """Return the filter's arrays of `PARTS` at one speed, the delay line filled up to `taps`."""
    n, f, rates, p = d.sampled.size, d.filter, d.system.rates, len(d.rows)
    own = (len(d.sampled.A) - n) // 2
    kept = min(own, taps)
    K_taps, P_taps = np.zeros((2, taps, p)), np.zeros((4, 2, taps))
    K_taps[:, :kept] = f.K[n:].reshape(2, own, p)[:, :kept]
    P_taps[:, :, :kept] = f.P[rates, n:].reshape(4, 2, own)[:, :, :kept]
    return {
        "K": f.K[:n],
        "K_taps": K_taps,
        "P": -f.P[rates, :n],
        "P_taps": -P_taps,
        "information": np.asarray(np.linalg.inv(f.S), np.float64),
        "deviation": d.deviation(),
    }


def write_all(directory: Path, progress: Callable[[str], None]) -> None:
    """Write every variant's filter for every condition, `<name>_<condition>.npz`."""
    directory.mkdir(parents=True, exist_ok=True)
    all_plants = plants(SPEEDS)
    for condition in CONDITIONS:
        for name, variant in VARIANTS.items():
            path = directory / f"{name}_{condition}.npz"
            kalman_model(all_plants, variant, condition).save(path)
            progress(str(path))
