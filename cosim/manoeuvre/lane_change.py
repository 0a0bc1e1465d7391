"""Obstacle avoidance through the gates of ISO 3888-2:2011."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PPoly

from cosim.manoeuvre.gates import Body, Edge

Array = npt.NDArray[np.float64]

LENGTHS: Final = (12.0, 13.5, 11.0, 12.5, 12.0)  # of the five sections [m]
SIDE_OFFSET: Final = 1.0  # from the left edge of section 1 to the right edge of section 3 [m]
MARGIN: Final = 0.12  # planned between body and edges; section 1 leaves 0.22 m on either side [m]
STEP: Final = 1.0  # of the planned path [m]
RUN_OUT: Final = 10.0  # behind section 5, for the path to become straight [m]
SHARPNESS: Final = 3.0  # weight of the change of curvature against the curvature [m]


@dataclass(frozen=True)
class Gate:
    """A section between cones, in the course's own coordinates: x from its entry, y to the left
    from the middle of section 1 [m].
    """

    start: float
    end: float
    right: float
    left: float

    @property
    def middle(self) -> float:
        """Lateral place of its middle [m]."""
        return 0.5 * (self.left + self.right)


def gates(width: float) -> tuple[Gate, Gate, Gate]:
    """Return sections 1, 3 and 5 for a vehicle `width` [m] without mirrors (Table 1 of the
    standard). Sections 1 and 5 are taken to have their right edges in line.
    """
    first, third = 1.1 * width + 0.25, width + 1.0
    fifth = max(1.3 * width + 0.25, 3.0)
    ends = np.cumsum(LENGTHS).tolist()
    right = -0.5 * first
    inner = 0.5 * first + SIDE_OFFSET
    return (
        Gate(0.0, ends[0], right, right + first),
        Gate(ends[1], ends[2], inner, inner + third),
        Gate(ends[3], ends[4], right, right + fifth),
    )


def edges(sections: tuple[Gate, ...], x: float, y: float) -> tuple[Edge, ...]:
    """Return both edges of each section, the course's entry being at (x, y) on the road [m]."""
    return tuple(
        Edge(x + gate.start, x + gate.end, y + lateral, keep_left)
        for gate in sections
        for lateral, keep_left in ((gate.right, True), (gate.left, False))
    )


def gentlest_path(sections: tuple[Gate, ...], body: Body, side_slip: float) -> PPoly:
    """Return y(x) [m] of the reference point from the entry to `RUN_OUT` behind section 5.

    Of all paths that leave the body `MARGIN` to every edge, the one that bends least and most
    evenly: what is smallest is the largest |second derivative| plus SHARPNESS times the largest
    |third|, which is constant over each step. Angles are taken as small, and the body points to the
    inside of the path by `side_slip` [rad m] times the second derivative, negative for its outside,
    so this is a linear programme in the third derivatives. The path begins in the middle of section
    1 and ends wherever it likes, straight both times. Raises `ValueError` where nothing leads a
    body of this shape through the gates.
    """
    from scipy.optimize import linprog

    x = np.arange(0.0, sections[-1].end + RUN_OUT + 0.5 * STEP, STEP)
    y, slope, bend = _integrals(x)
    places, room = _constraints(sections, body, x, y, slope - side_slip * bend)
    n = len(x) - 1
    # Two more unknowns bound the second and the third derivatives.
    bounded = np.vstack(
        [
            np.hstack((places, np.zeros((len(places), 2)))),
            *(_with(sign * bend, -1.0, 0.0) for sign in (1.0, -1.0)),
            *(_with(sign * np.eye(n), 0.0, -1.0) for sign in (1.0, -1.0)),
        ]
    )
    found = linprog(
        np.concatenate((np.zeros(n), [1.0, SHARPNESS])),
        A_ub=bounded,
        b_ub=np.concatenate((room, np.zeros(len(bounded) - len(room)))),
        A_eq=_with(np.vstack((slope[-1], bend[-1])), 0.0, 0.0),
        b_eq=np.zeros(2),
        bounds=[(None, None)] * n + [(0.0, None)] * 2,
    )
    if found.x is None:
        raise ValueError("nothing leads a body of this shape through the gates")
    third = found.x[:n]
    at_start = [(matrix @ third)[:-1] for matrix in (bend, slope, y)]
    return PPoly(np.array([third / 6.0, at_start[0] / 2.0, at_start[1], at_start[2]]), x)


def _with(matrix: Array, second: float, third: float) -> Array:
    """Return the matrix with a column each for the bounds of second and third derivative."""
    rows = len(matrix)
    return np.hstack((matrix, np.full((rows, 1), second), np.full((rows, 1), third)))


def _integrals(x: Array) -> tuple[Array, Array, Array]:
    """Return the matrices that turn the third derivative of each step into value, first and second
    derivative at each x, (n + 1, n).
    """
    h = np.diff(x)
    behind = x[:, None] - x[None, 1:]
    done = behind >= -0.5 * STEP
    rest = np.where(done, behind, 0.0)
    y = h**3 / 6.0 + h**2 / 2.0 * rest + h / 2.0 * rest**2
    slope = h**2 / 2.0 + h * rest
    return y * done, slope * done, h * done


def _constraints(
    sections: tuple[Gate, ...], body: Body, x: Array, y: Array, yaw: Array
) -> tuple[Array, Array]:
    """Return a matrix (m, n) whose product with the third derivatives must not exceed (m,), or a
    side of the body is too near an edge.
    """
    rows: list[Array] = []
    room: list[float] = []
    for gate in sections:
        for k, place in enumerate(x.tolist()):
            ends = max(gate.start - place, -body.rear), min(gate.end - place, body.front)
            if ends[0] > ends[1]:
                continue
            for ahead in ends:  # of the part of the body that is beside the section
                side = y[k] + ahead * yaw[k]
                rows += [side, -side]
                room += [gate.left - MARGIN - body.left, -(gate.right + MARGIN + body.right)]
    return np.array(rows), np.array(room)


def moved(path: PPoly, x: float, y: float) -> PPoly:
    """Return the path with its beginning at (x, y) on the road [m]."""
    coefficients = path.c.copy()
    coefficients[-1] += y
    return PPoly(coefficients, path.x + x)
