"""A surface and the obstacles on it as one grid of elevations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosim.road.errors import RoadError
from cosim.road.obstacles import Obstacle
from cosim.road.surface import (
    FINE_STEP,
    Floats,
    Grid,
    Surface,
    finer_grid,
    finer_sections,
    on_columns,
)
from cosim.road.track import DS

MOST_POINTS: Final = 16_000_000  # of a road's grid: a file of 64 MB


@dataclass(frozen=True, eq=False)
class RoadGrid:
    """Elevations [m], shape (len(s), len(v)), at the cross sections `s` and the columns `v` [m]."""

    s: Floats
    v: Floats
    elevation: Grid

    @property
    def step(self) -> float:
        """Distance of the cross sections [m]."""
        return DS if self.s[1] - self.s[0] > 0.75 * DS else FINE_STEP


def road_grid(track_s: Floats, surface: Surface, obstacles: Sequence[Obstacle] = ()) -> RoadGrid:
    """Lay `obstacles` over `surface` along the track's own cross sections, or twice as many where
    stones or obstacles need them.

    The surface is the same with obstacles as without. Raises `RoadError` for a grid that would be
    too large.
    """
    fine = bool(obstacles) or surface.step < DS
    s = finer_sections(track_s) if fine else track_s
    own = s if surface.step < DS else track_s
    places = surface.columns(own)
    corners = [place for obstacle in obstacles for place in obstacle.columns()]
    v: Floats = np.unique(np.array([round(q, 3) for q in (*places.tolist(), *corners)]))
    if len(s) * len(v) > MOST_POINTS:
        raise RoadError(
            f"the road's grid would have {len(s) * len(v) / 1e6:.0f} million points, more than "
            f"{MOST_POINTS / 1e6:.0f} million: take a shorter road, or fewer obstacles"
        )
    grid = surface.elevation(own, places)
    grid = on_columns(finer_grid(grid) if len(own) < len(s) else grid, places, v)
    for obstacle in obstacles:
        grid = np.asarray(grid + obstacle.elevation(s, v), dtype=np.float32)
    return RoadGrid(s, v, grid)
