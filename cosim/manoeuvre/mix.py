"""A mix of everything: random accelerating, braking and cornering, with stretches of swaying."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.manoeuvre.line import beside_bends, deviation
from cosim.manoeuvre.motion import Motion
from cosim.manoeuvre.plan import KMH, RUN_UP_S, Figures, Plan
from cosim.road.track import Track
from cosim.speed_profile import Limits, profile_within, travel_time

Array = npt.NDArray[np.float64]

FASTEST_MIX: Final = 120.0  # km/h, where the driver has no speed of his own
SLOWEST: Final = 10.0 / KMH  # [m/s]
LONGITUDINAL: Final = 7.0  # m/s2, the hardest on dry asphalt
LATERAL: Final = 7.0
_GENTLEST: Final = 0.5  # m/s2 along
_STRAIGHTEST: Final = 1.5  # m/s2 across
_HARDEST_START: Final = 4.5  # m/s2; the engine has no more
_DURATION: Final = (3.0, 12.0)  # of a section at its wanted speed [s]
_SHORTEST: Final = 15.0  # section [m]
_SWAYING: Final = 0.4  # share of sections
_SWAY: Final = (0.08, 0.35)  # m to either side: the wheels stay where the road's grid is dense
_PERIOD: Final = (1.5, 4.0)  # of swaying [s]
_STREAM: Final = 1  # of the seed's random numbers; a winding road of the same seed draws its own


@dataclass(frozen=True)
class Section:
    """A stretch of road from `start` [m] on, `length` [m] long, with its wanted `speed` [m/s] and
    the largest accelerations on it [m/s2]; `sway` [m] to either side every `wave` [m].
    """

    start: float
    length: float
    speed: float
    accelerate: float
    brake: float
    corner: float
    sway: float
    wave: float

    def offset(self, s: Array) -> Array:
        """Return the swaying at `s` [m], to the left; without a kink in its curvature's integral
        where it begins and ends, over half a wave each.
        """
        ramp = 0.5 * self.wave
        near = np.minimum(s - self.start, self.start + self.length - s)
        share = np.clip(near / ramp, 0.0, 1.0)
        blend = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        turn = 2.0 * math.pi * (s - self.start) / self.wave
        return np.asarray(self.sway * blend * np.sin(turn))


@dataclass(frozen=True)
class Mix:
    """Random wanted speeds from 10 km/h to `top` [m/s] along a road, reached by gentle to hard
    accelerating and braking, bends taken at up to 7 m/s2 on dry asphalt, swaying now and then.

    Everything follows from `seed` and the length of the road.
    """

    seed: int
    top: float
    friction: float = 1.0

    @property
    def road_length(self) -> float | None:
        """The road's own."""
        return None

    def plan(self, track: Track) -> Plan:
        """Return the plan."""
        sections = self.sections(track.length)
        line, places = beside_bends(track, partial(_swaying, sections))
        starts = np.array([section.start for section in sections])
        which = np.clip(np.searchsorted(starts, places, "right") - 1, 0, None)

        def of(value: Callable[[Section], float]) -> Array:
            return np.array([value(section) for section in sections])[which]

        limits = Limits(of(lambda x: x.accelerate), of(lambda x: x.brake), of(lambda x: x.corner))
        wanted = np.minimum(of(lambda x: x.speed), line.speed_limit)
        speed = profile_within(line, wanted, limits)
        return Plan(line, speed, travel_time(line, speed), partial(mix_figures, line=line))

    def sections(self, length: float) -> list[Section]:
        """Return the sections of a road of `length` [m]; the first begins behind the run-up."""
        random = np.random.default_rng([self.seed, _STREAM])
        along, across = self.friction * LONGITUDINAL, self.friction * LATERAL
        sections: list[Section] = []
        place = 0.0
        while place < length:
            speed = random.uniform(min(SLOWEST, self.top), self.top)
            size = max(speed * random.uniform(*_DURATION), _SHORTEST)
            accelerate, brake = (
                math.exp(random.uniform(math.log(_GENTLEST), math.log(hardest)))
                for hardest in (_HARDEST_START, LONGITUDINAL)
            )
            corner = random.uniform(_STRAIGHTEST, LATERAL)
            sways, wide, period = random.random(), random.uniform(*_SWAY), random.uniform(*_PERIOD)
            wave = speed * period
            calm = place < RUN_UP_S * self.top or sways > _SWAYING or size < 2.0 * wave
            sections.append(
                Section(
                    place, size, speed, min(accelerate, along), min(brake, along),
                    min(corner, across), 0.0 if calm else wide, wave,
                )
            )  # fmt: skip
            place += size
        return sections


def _swaying(sections: list[Section], s: Array) -> Array:
    """Return the offset of the driven line from the road's [m] at `s` [m]."""
    offset = np.zeros_like(s)
    for section in sections:
        if section.sway > 0.0:
            here = slice(*np.searchsorted(s, (section.start, section.start + section.length)))
            offset[here] = section.offset(s[here])
    return offset


def mix_figures(motion: Motion, line: Track) -> Figures:
    """Return the mean speed and the largest deviation, lateral acceleration and yaw rate."""
    off = deviation(motion, line, 0.0, float(motion.travelled[-1]))
    return {
        "speed_mean_kmh": float(motion.vx.mean()) * KMH,
        "path_deviation_m": float(np.abs(off).max()),
        "lateral_acceleration_max_m_s2": float(np.abs(motion.ay).max()),
        "yaw_rate_max_deg_s": float(np.degrees(np.abs(motion.yaw_rate).max())),
    }
