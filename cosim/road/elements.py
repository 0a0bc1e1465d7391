"""Road layouts as road builders write them: straights and arcs, with clothoids in between.

A layout is a line of text such as ``S200 R68/69 L150/35``: a straight of 200 m, a right-hand arc of
radius 68 m that turns by 69 degrees, a left-hand one of 150 m and 35 degrees. Curvature is positive
to the left [1/m], headings count counter-clockwise [rad].
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PPoly

from cosim.road.errors import RoadError

Floats = npt.NDArray[np.float64]

_LARGEST_SHARE = 0.48  # of an element that one of its clothoids may use, so that two never meet
_GAUSS_NODES, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True)
class Straight:
    """A straight of `length` [m]."""

    length: float

    @property
    def curvature(self) -> float:
        """Zero."""
        return 0.0


@dataclass(frozen=True)
class Arc:
    """A circular arc of `radius` [m] turning by `angle_deg` [deg], to the left or to the right."""

    radius: float
    angle_deg: float
    left: bool

    @property
    def length(self) -> float:
        """Length along the arc [m]."""
        return self.radius * math.radians(self.angle_deg)

    @property
    def curvature(self) -> float:
        """Positive to the left [1/m]."""
        return (1.0 if self.left else -1.0) / self.radius


Element = Straight | Arc


def parse_layout(text: str) -> tuple[Element, ...]:
    """Return the elements of a layout line; `RoadError` names the word that is not one."""
    return tuple(_parse_word(word) for word in text.split())


def _parse_word(word: str) -> Element:
    kind, numbers = word[:1], word[1:].split("/")
    try:
        values = [float(number) for number in numbers]
    except ValueError:
        values = []
    if all(0.0 < value < math.inf for value in values):
        if kind == "S" and len(values) == 1:
            return Straight(values[0])
        if kind in ("L", "R") and len(values) == 2:
            return Arc(values[0], values[1], left=kind == "L")
    raise RoadError(f"'{word}' is no road element; write S200, L150/35 or R68/69 (m, m/deg)")


def curvature_profile(elements: Sequence[Element], transition: float) -> PPoly:
    """Return curvature over s from 0 to the layout's length, linear piece by piece [1/m over m].

    Each change of curvature becomes a clothoid of length `transition` [m], or shorter where an
    element leaves no room, centred on the place of the change: the integral over it stays the same,
    so every heading change and the length of the road are those of the layout.
    """
    knots, values = [0.0], [elements[0].curvature]
    end = 0.0
    for before, after in itertools.pairwise(elements):
        end += before.length
        if before.curvature == after.curvature:
            continue
        room = _LARGEST_SHARE * min(before.length, after.length)
        half = min(0.5 * transition, room)
        knots += [end - half, end + half]
        values += [before.curvature, after.curvature]
    knots.append(end + elements[-1].length)
    values.append(elements[-1].curvature)
    slopes = np.diff(values) / np.diff(knots)
    return PPoly(np.array([slopes, values[:-1]]), np.array(knots))


def follow(heading: Floats, ds: float) -> tuple[Floats, Floats]:
    """Return x, y [m] of a line from (0, 0) whose `heading` has shape (n, 4), at Gauss points.

    Row i holds the headings at the four Gauss-Legendre points of step i, of length `ds` [m]; the
    result has shape (n + 1,).
    """
    x = np.concatenate(([0.0], np.cumsum(np.cos(heading) @ _GAUSS_WEIGHTS) * (0.5 * ds)))
    y = np.concatenate(([0.0], np.cumsum(np.sin(heading) @ _GAUSS_WEIGHTS) * (0.5 * ds)))
    return x, y


def gauss_points(s: Floats) -> Floats:
    """Return the four Gauss-Legendre points of each step of the grid `s`, shape (n - 1, 4) [m]."""
    middle, half = 0.5 * (s[1:] + s[:-1]), 0.5 * np.diff(s)
    points: Floats = middle[:, None] + half[:, None] * _GAUSS_NODES
    return points


def close_circuit(
    elements: Sequence[Element], transition: float, adjustable: tuple[int, int]
) -> tuple[Element, ...]:
    """Return the elements, the straights at `adjustable` changed so that end and start meet.

    Raises `RoadError` if the arcs do not turn by a whole circle, or a straight would vanish.
    """
    turn = sum(e.curvature * e.length for e in elements)
    if abs(abs(turn) - 2.0 * math.pi) > 1e-9:
        raise RoadError(f"the circuit turns by {math.degrees(turn):.3f} deg; it must be 360 deg")
    closed = list(elements)
    for _ in range(3):  # once would do if no clothoid were cut short by its straight
        gap, directions = _closing_gap(closed, transition, adjustable)
        for index, change in zip(adjustable, np.linalg.solve(directions, -gap), strict=True):
            element = closed[index]
            if not isinstance(element, Straight) or element.length + change < 1.0:
                raise RoadError(f"element {index + 1} cannot close the circuit; name another")
            closed[index] = replace(element, length=element.length + float(change))
    return tuple(closed)


def _closing_gap(
    elements: Sequence[Element], transition: float, adjustable: tuple[int, int]
) -> tuple[Floats, Floats]:
    """Return end minus start [m], shape (2,), and the two straights' directions, shape (2, 2)."""
    heading = curvature_profile(elements, transition).antiderivative()
    ends = np.cumsum([e.length for e in elements])
    s = np.linspace(0.0, ends[-1], math.ceil(ends[-1] / 0.05) + 1)
    x, y = follow(heading(gauss_points(s)), float(s[1]))
    middles = [ends[i] - 0.5 * elements[i].length for i in adjustable]
    angles = heading(np.array(middles))
    return np.array([x[-1], y[-1]]), np.array([np.cos(angles), np.sin(angles)])
