"""The body's outline against cones and gates on a straight road along x."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.manoeuvre.motion import Motion

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """The body's rectangle: its ends ahead of and behind the reference point, its sides to the left
    and the right of it [m], all positive.
    """

    front: float
    rear: float
    left: float
    right: float

    @property
    def width(self) -> float:
        """Width [m]."""
        return self.left + self.right

    def corners(self, x: Array, y: Array, yaw: Array) -> tuple[Array, Array]:
        """Return x and y of the corners, (4, n), in turn around the body."""
        along = np.array([[self.front], [self.front], [-self.rear], [-self.rear]])
        across = np.array([[self.left], [-self.right], [-self.right], [self.left]])
        cosine, sine = np.cos(yaw), np.sin(yaw)
        return x + along * cosine - across * sine, y + along * sine + across * cosine


@dataclass(frozen=True)
class Edge:
    """Cones in a row from x = `start` to `end` [m], at y [m], tangential to their base circles.

    The body has to keep to the left of it, or to the right. A single cone starts and ends at the
    same x.
    """

    start: float
    end: float
    y: float
    keep_left: bool


def clearance(motion: Motion, body: Body, edges: Sequence[Edge]) -> float | None:
    """Return the smallest lateral distance [m] of the body to an edge while it is beside it.

    Positive where no cone is touched; None where the car has not passed every edge.
    """
    x, y = body.corners(motion.x, motion.y, motion.yaw)
    smallest = []
    for edge in edges:
        if not x.size or x.min(axis=0).max() <= edge.end:
            return None
        low, high = lateral_extent(x, y, edge.start, edge.end)
        distance = low - edge.y if edge.keep_left else edge.y - high
        smallest.append(float(np.nanmin(distance)))
    return min(smallest)


def lateral_extent(x: Array, y: Array, start: float, end: float) -> tuple[Array, Array]:
    """Return the least and the greatest y (n,) of polygons (4, n) between x = start and x = end.

    NaN where a polygon does not reach into the strip.
    """
    candidates = [np.where((x >= start) & (x <= end), y, np.nan)]
    x2, y2 = np.roll(x, -1, axis=0), np.roll(y, -1, axis=0)
    for border in (start, end):
        crosses = (x - border) * (x2 - border) < 0.0
        run = np.where(crosses, x2 - x, 1.0)
        candidates.append(np.where(crosses, y + (border - x) / run * (y2 - y), np.nan))
    points = np.concatenate(candidates)
    none = np.isnan(points).all(axis=0)
    low = np.where(none, np.nan, np.where(np.isnan(points), np.inf, points).min(axis=0))
    high = np.where(none, np.nan, np.where(np.isnan(points), -np.inf, points).max(axis=0))
    return low, high
