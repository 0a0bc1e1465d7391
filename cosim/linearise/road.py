"""The road under each wheel as inputs of the linear vehicle.

The built-in FMU has no input for the road: it reads a file. So one state steps on roads of which
one quarter, under one wheel, lies a little higher, or rises a little; the difference to an even
road is that wheel's share.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosim.fmi import Description, Value
from cosim.linearise.fmu import STEP, Steps, linearise
from cosim.linearise.model import LinearModel
from cosim.quantities import CORNERS
from cosim.road.crg import write_crg
from cosim.road.grid import RoadGrid
from cosim.road.track import DS, Track

Array = npt.NDArray[np.float64]

HEIGHT, SLOPE = 2.0**-17, 2.0**-14  # [m], [1]: exact in the road file's single precision
LENGTH = 60.0  # of the road, the car in its middle [m]
COLUMNS = np.array([-4.5, -0.1, 0.1, 4.5])  # left and right of the car [m]
SEEN = (*(f"Car.zRoad{c}" for c in CORNERS), "Car.vx")


@dataclass(frozen=True)
class Push:
    """How a step ends with one quarter of the road changed, against an even road.

    Coordinates after a whole and a half step (2, n), outputs after the half one (p,), elevation
    under the wheel at the beginning of both and at the end of the half one.
    """

    whole: Array
    half: Array
    outputs: Array
    elevation: tuple[float, float, float]

    def columns(self, C: Array) -> tuple[Array, Array]:
        """Return the columns of B (n,) and D (p,) of the elevation."""
        rate = (4.0 * self.half - self.whole) / (STEP * HEIGHT)
        return rate, (self.outputs - C @ self.half) / HEIGHT

    def slope_columns(self, C: Array, lift: Push) -> tuple[Array, Array]:
        """Return the columns of B and D of the slope: what the elevation, `lift`, leaves over."""
        first, second, end = (z / HEIGHT for z in self.elevation)
        whole, half = self.whole - first * lift.whole, self.half - second * lift.half
        by_elevation = end * (lift.outputs - C @ lift.half)
        D = (self.outputs - C @ self.half - by_elevation) / SLOPE
        return (4.0 * half - whole) / (STEP * SLOPE), D


def linearise_on_road(
    description: Description,
    start: Mapping[str, Value],
    inputs: Mapping[str, float],
    outputs: Sequence[str],
) -> LinearModel:
    """Return `linearise` on an even road, with the inputs "Road.z.FL" ... and "Road.slope.FL" ....

    They are elevation [m] and forward slope [1] of the road under each wheel, as its contact patch
    averages them. `start` leaves Init.x, Init.y and Init.Yaw at zero. Raises `FmuError`.
    """
    with tempfile.TemporaryDirectory() as name:
        roads = Roads(Path(name), description, start, inputs, outputs)
        model = linearise(description, {**start, "Road.File": roads.even}, inputs, outputs)
        lifts = [roads.push(i, HEIGHT, 0.0) for i in range(4)]
        ramps = [roads.push(i, 0.0, SLOPE) for i in range(4)]
    columns = [lift.columns(model.C) for lift in lifts]
    columns += [ramp.slope_columns(model.C, lift) for lift, ramp in zip(lifts, ramps, strict=True)]
    names = [f"Road.{kind}.{c}" for kind in ("z", "slope") for c in CORNERS]
    B, D = (np.column_stack([pair[k] for pair in columns]) for k in (0, 1))
    return model.with_inputs(names, B, D)


class Roads:
    """Steps of one state on an even road and on roads with one quarter changed."""

    def __init__(
        self,
        folder: Path,
        description: Description,
        start: Mapping[str, Value],
        inputs: Mapping[str, float],
        outputs: Sequence[str],
    ) -> None:
        self._folder, self._description = folder, description
        self._start, self._inputs = start, inputs
        self._outputs = (*outputs, *SEEN)
        self.even = self._file(0, 0.0, 0.0)
        with self._steps(self.even) as steps:
            self._words = steps.words
            self._flat = [steps.step(steps.words, steps.inputs, e) for e in (STEP, 0.5 * STEP)]
        self._speed = float(self._flat[0].outputs[-1])

    def _steps(self, file: str) -> Steps:
        start = {**self._start, "Road.File": file}
        return Steps(self._description, start, self._inputs, self._outputs)

    def push(self, corner: int, height: float, slope: float) -> Push:
        """Return what a quarter of the road, raised or rising, does to the step."""
        with self._steps(self._file(corner, height, slope)) as steps:
            ends = [steps.step(self._words, steps.inputs, e) for e in (STEP, 0.5 * STEP)]
            whole, half = (
                steps.layout.difference(end.words, flat.words)
                for end, flat in zip(ends, self._flat, strict=True)
            )
        p = len(self._outputs) - len(SEEN)
        under = [float(end.outputs[p + corner]) for end in ends]
        begin = [
            z - slope * self._speed * e for z, e in zip(under, (STEP, 0.5 * STEP), strict=True)
        ]
        change = (ends[1].outputs - self._flat[1].outputs)[:p]
        return Push(whole, half, change, (begin[0], begin[1], under[1]))

    def _file(self, corner: int, height: float, slope: float) -> str:
        """Write the road whose quarter under one wheel has this elevation at x = 0 and slope."""
        path = self._folder / f"{corner}-{height:g}-{slope:g}.crg"
        s = np.arange(round(LENGTH / DS) + 1, dtype=np.float64) * DS - 0.5 * LENGTH
        zero = np.zeros_like(s)
        track = Track(
            name=path.stem, length=0.5 * LENGTH, closed=False, s=s, x=s.copy(), y=zero, z=zero,
            heading=zero, curvature=zero, grade=zero, banking=zero, speed_limit=zero + np.inf,
        )  # fmt: skip
        front, left = corner < 2, corner % 2 == 0
        along = (s > 0.0) == front
        across = (COLUMNS > 0.0) == left
        grid = np.outer((height + slope * s) * along, across)
        write_crg(path, track, RoadGrid(s, COLUMNS, grid.astype(np.float32)))
        return str(path)
