"""A slalom: cones in a row on the road's line, passed in turn to the left and to the right."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.interpolate import BPoly, PPoly

from cosim.manoeuvre.gates import Body, Edge

CONE_RADIUS: Final = 0.15  # of the base circle of a cone 500 mm high [m]


@dataclass(frozen=True)
class Cones:
    """`count` cones `spacing` [m] apart, the first at x = `first` [m]; odd ones are passed to their
    left.
    """

    first: float
    spacing: float
    count: int

    @property
    def places(self) -> list[float]:
        """Where the cones stand along the road, x [m]."""
        return [self.first + i * self.spacing for i in range(self.count)]

    @property
    def edges(self) -> tuple[Edge, ...]:
        """The side of each base circle that the body passes."""
        return tuple(
            Edge(x, x, -CONE_RADIUS if i % 2 else CONE_RADIUS, keep_left=not i % 2)
            for i, x in enumerate(self.places)
        )


def bend_at_cones(spacing: float, clearance: float, width: float) -> float:
    """Return |d2y/dx2| [1/m] at the cones of the path of a body so wide: that of a sine."""
    return float((CONE_RADIUS + clearance + 0.5 * width) * (np.pi / spacing) ** 2)


def path(cones: Cones, body: Body, clearance: float) -> PPoly:
    """Return y(x) [m] of the reference point, straight one spacing before and behind the cones.

    At each cone it has its extremum, where the body's side is `clearance` [m] from the cone. There
    the second derivative is that of a sine; quintics join the cones.
    """
    far = CONE_RADIUS + clearance
    left, right = far + body.right, -(far + body.left)
    bend = bend_at_cones(cones.spacing, clearance, body.width)
    states = [(right, 0.0, bend) if i % 2 else (left, 0.0, -bend) for i in range(cones.count)]
    straight = (0.0, 0.0, 0.0)
    ends = cones.first - cones.spacing, cones.first + cones.count * cones.spacing
    knots = [ends[0], *cones.places, ends[1]]
    return PPoly.from_bernstein_basis(BPoly.from_derivatives(knots, [straight, *states, straight]))
