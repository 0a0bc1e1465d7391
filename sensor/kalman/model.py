"""A Kalman filter's numbers on a grid of speeds, as its file holds them, and in between."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sensor.channels import (
    CHANNEL_NAMES,
    CHANNEL_UNITS,
    CHANNELS,
    OUTPUT_NAMES,
    OUTPUT_UNITS,
    OUTPUTS,
    PASSIVE_COMMAND,
    SAMPLE_RATE_HZ,
    check_channels,
)
from sensor.errors import SensorError

Array = npt.NDArray[np.float64]

MODEL: Final = {
    "still": "measured channels straight on over an even road (p,)",
    "rest": "the vehicle's state there (n,)",
    "F": "state over one substep (n, n)",
    "rear": "what the delayed front road, (sum, difference), does to the state (n, 2)",
    "steer": "what the steering-wheel angle does to it (n,)",
    "damper": "what a force of the dampers beyond the linear one does to it (n, 4)",
    "H": "measured channels from the state (p, n)",
    "D": "measured channels from the steering-wheel angle (p,)",
    "damping": "of the linear dampers at the wheels (4,) [N s/m]",
}
GAINS: Final = {
    "K": "gain (n, p)",
    "K_taps": "gain of the delay line's newest m taps (2, m, p)",
    "P": "filtered covariance of the suspension velocities with the state (4, n)",
    "P_taps": "and with the delay line (4, 2, m)",
    "information": "inverse covariance of the innovations (p, p)",
    "deviation": "standard deviation of the estimate (4,) [m/s]",
}
"""Arrays of a filter made for one damping and one kind of driving."""
DAMPERS: Final = ("soft", "passive", "hard")
DRIVING: Final = ("tight", "loose")  # straight on; speeding up, braking or cornering
SETS: Final = tuple(f"{driving}_{damper}_" for driving in DRIVING for damper in DAMPERS)
PARTS: Final = {
    **MODEL,
    **{f"{prefix}{name}": text for prefix in SETS for name, text in GAINS.items()},
}
"""Arrays of a model, each with the speeds as its first axis."""


@dataclass(frozen=True)
class KalmanModel:
    """The filter's model and gains at `speeds` (s,) [m/s], ascending; below and beyond they hold.

    `parts` are the arrays of `PARTS`, their first axis the speeds; `rows` (p,) the channels that
    are measured; `rates` (4,) where the travel rates stand in the state; `offsets` (p,) where the
    channels' offsets stand, and `first` (p,) which share of the first innovation they take;
    `moved` (2, k) which states become which at the beginning of a sample; `limits` (p,) the largest
    innovations that count; `calibration` the factor on the predicted deviation; `wheelbase` [m];
    `substeps` of a sample, `taps` of the delay line, 0 for a filter without one.
    """

    speeds: Array
    parts: Mapping[str, Array]
    rows: npt.NDArray[np.int64]
    rates: npt.NDArray[np.int64]
    offsets: npt.NDArray[np.int64]
    first: Array
    moved: npt.NDArray[np.int64]
    limits: Array
    calibration: float
    wheelbase: float
    substeps: int
    taps: int
    about: Mapping[str, Any]

    def moved_slices(self) -> tuple[slice, slice] | None:
        """Return `moved` as slices, None if it is empty."""
        if not self.moved.size:
            return None
        before, after = (slice(int(part[0]), int(part[-1]) + 1) for part in self.moved)
        return before, after

    def save(self, path: str | Path) -> None:
        """Write an .npz file; the same model gives the same bytes."""
        about = {
            "sample_rate_hz": SAMPLE_RATE_HZ,
            "inputs": {"names": CHANNEL_NAMES, "units": CHANNEL_UNITS},
            "outputs": {"names": OUTPUT_NAMES, "units": OUTPUT_UNITS},
            "calibration": self.calibration,
            "wheelbase": self.wheelbase,
            "substeps": self.substeps,
            "taps": self.taps,
            "design": dict(self.about),
        }
        numbers = {name: self.parts[name].astype(np.float32) for name in MODEL}
        for name in _HALVES:
            numbers |= _halved(name, self.parts[name])
        places = {n: getattr(self, n) for n in ("rows", "rates", "offsets", "moved")}
        vectors = {n: getattr(self, n).astype(np.float32) for n in ("speeds", "first", "limits")}
        text = np.array(json.dumps(about, sort_keys=True))
        arrays: dict[str, Any] = {"metadata": text, **numbers, **places, **vectors}
        np.savez_compressed(path, **arrays)

    @classmethod
    def load(cls, path: str | Path) -> "KalmanModel":
        """Read a model; raises SensorError if the file is none or its channels, units or rate
        differ from this sensor's.
        """
        try:
            with np.load(path, allow_pickle=False) as content:
                about = json.loads(str(content["metadata"]))
                parts = {name: content[name].astype(np.float64) for name in MODEL}
                parts |= {name: _whole(content, name) for name in _HALVES}
                places = {n: content[n].astype(np.int64) for n in _PLACES}
                vectors = {n: content[n].astype(np.float64) for n in _VECTORS}
            inputs, outputs, rate = about["inputs"], about["outputs"], about["sample_rate_hz"]
        except (OSError, ValueError, KeyError) as error:
            raise SensorError(f"{path}: it cannot be read as a Kalman filter: {error}") from error
        check_channels(f"{path}, inputs", inputs["names"], inputs["units"], CHANNELS)
        check_channels(f"{path}, outputs", outputs["names"], outputs["units"], OUTPUTS)
        if rate != SAMPLE_RATE_HZ:
            raise SensorError(f"{path}: it expects {rate:g} Hz, where {SAMPLE_RATE_HZ} Hz belongs.")
        return cls(
            parts=parts,
            calibration=float(about["calibration"]),
            wheelbase=float(about["wheelbase"]),
            substeps=int(about["substeps"]),
            taps=int(about["taps"]),
            about=about["design"],
            **places,
            **vectors,
        )


_HALVES: Final = tuple(name for name in PARTS if name not in MODEL)


def _halved(name: str, part: Array) -> dict[str, npt.NDArray[np.floating[Any]]]:
    """Return a gain in half precision, each of its lines relative to the largest value in it."""
    others = tuple(i for i in range(part.ndim) if i != 1)
    largest = np.abs(part).max(axis=others, keepdims=True, initial=1e-30).astype(np.float32)
    return {name: (part / largest).astype(np.float16), f"{name}_unit": largest}


def _whole(content: Mapping[str, Any], name: str) -> Array:
    return np.asarray(content[name].astype(np.float64) * content[f"{name}_unit"])


_PLACES: Final = ("rows", "rates", "offsets", "moved")
_VECTORS: Final = ("speeds", "first", "limits")


@dataclass(frozen=True)
class Gains:
    """The arrays of `GAINS` for one damping and one kind of driving."""

    K: Array
    K_taps: Array
    P: Array
    P_taps: Array
    information: Array
    deviation: Array


class AtSpeed:
    """The arrays of a model at one speed, interpolated; `set` changes them in place."""

    def __init__(self, model: KalmanModel) -> None:
        count = len(model.speeds)
        self._speeds = model.speeds
        self._grid = np.hstack([model.parts[name].reshape(count, -1) for name in PARTS])
        self._now = self._grid[0].copy()
        self._other = self._grid[0].copy()
        self._follows = sum(model.parts[name][0].size for name in ("still", "rest"))
        ends = np.cumsum([model.parts[name][0].size for name in PARTS])[:-1]
        views = {
            name: values.reshape(model.parts[name].shape[1:])
            for name, values in zip(PARTS, np.split(self._now, ends), strict=True)
        }
        self.still, self.rest, self.H, self.D = (views[n] for n in ("still", "rest", "H", "D"))
        self.F, self.rear, self.steer = views["F"], views["rear"], views["steer"]
        self.damper, self.damping = views["damper"], views["damping"]
        self._sets = [Gains(*(views[f"{prefix}{name}"] for name in GAINS)) for prefix in SETS]

    def gains(self, valve: float, loose: float) -> list[tuple[Gains, float]]:
        """Return the sets of gains that count, with their shares: for a mean damper command
        `valve`, 0 soft to 1 hard, and driving that is `loose` from 0 to 1.
        """
        if valve < PASSIVE_COMMAND:
            dampers = ((0, 1.0 - valve / PASSIVE_COMMAND), (1, valve / PASSIVE_COMMAND))
        else:
            hard = (valve - PASSIVE_COMMAND) / (1.0 - PASSIVE_COMMAND)
            dampers = ((1, 1.0 - hard), (2, hard))
        driving = ((0, 1.0 - loose), (len(DAMPERS), loose))
        return [
            (self._sets[first + damper], of_driving * of_damper)
            for first, of_driving in driving
            for damper, of_damper in dampers
            if of_driving * of_damper > 0.0
        ]

    def set(self, speed: float) -> None:
        """Interpolate the arrays at `speed` [m/s]; the vehicle's resting state and its channels go
        on along the last line beyond the grid, since they follow the speed itself.
        """
        speeds = self._speeds
        place = int(np.searchsorted(speeds[1:-1], speed))
        share = float((speed - speeds[place]) / (speeds[place + 1] - speeds[place]))
        held = min(max(share, 0.0), 1.0)
        np.multiply(self._grid[place], 1.0 - held, out=self._now)
        np.multiply(self._grid[place + 1], held, out=self._other)
        self._now += self._other
        if share != held:
            ends = self._grid[place : place + 2, : self._follows]
            np.matmul(np.array([1.0 - share, share]), ends, out=self._now[: self._follows])
