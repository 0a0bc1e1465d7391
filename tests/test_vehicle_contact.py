"""The road as the wheels meet it: ISO 8608 at the contact points, left, right, and again behind."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from gates import at_least, between, gate
from scipy import signal
from validation_plots import log_bands, picture
from vehicle_rig import STEER, Array, Cruise, Record, Rig, parameter, run, straight_track

from cosim.fmi import Value
from cosim.road import Iso8608, build_road
from cosim.road.iso8608 import ROUGHNESS

SECTION = "Roads"
SPEED, H = 16.0, 0.002  # one sample each 0.032 m
BANDS = np.geomspace(0.04, 4.0, 13)  # [cycles/m]


@cache
def ride(kind: str, seconds: float) -> Record:
    road = str(build_road(straight_track(SPEED * seconds + 40.0), Iso8608(kind, 6)))
    start: dict[str, Value] = {"Init.Velocity": SPEED, "Road.File": road, "Damp.Passive": True}
    cruise = Cruise(SPEED)

    def drive(rig: Rig) -> None:
        cruise(rig)
        rig.inputs[STEER] = -0.05 * rig["Car.ty"] - rig["Car.Yaw"]

    return run(seconds, start, drive, h=H)


def densities(record: Record) -> tuple[Array, Array]:
    """Spatial frequency [cycles/m] and displacement spectra [m3] under the wheels, (n, 4).

    The patch's averaging is taken out again, by the mean over its length.
    """
    heights = record.corners("Car.zRoad@")[2000:]
    n, power = signal.welch(heights, 1.0 / (SPEED * H), nperseg=8192, axis=0,
                            detrend="linear")  # fmt: skip
    patch = np.sinc(n * parameter("Road.PatchLength")) ** 2
    return n, np.asarray(power / patch[:, None])


def ratios(kind: str, seconds: float) -> Array:
    """Spectrum over the class's own, in bands, (bands, 4)."""
    n, power = densities(ride(kind, seconds))
    nominal = ROUGHNESS[kind] * (np.maximum(n, 1e-9) / 0.1) ** -2.0
    edges = pairwise(BANDS)
    rows = [(power / nominal[:, None])[(n >= a) & (n < b)].mean(axis=0) for a, b in edges]
    return np.array(rows)


@pytest.mark.validation
@pytest.mark.parametrize("kind", ["A", "B", "C", "D"])
def test_the_wheels_meet_the_class(kind: str) -> None:
    found = ratios(kind, 120.0)
    check = f"ISO 8608 class {kind} at the FMU's contact points, 12 bands 0.04 to 4 1/m, "
    extremes = [found.min(), found.max()]
    gate(SECTION, check + "lowest and highest over the class's mean [-]",
         "ISO 8608: the class lies within 0.5 to 2", extremes, between(0.5, 2.0))  # fmt: skip
    gate(SECTION, check + "mean [-]", "ISO 8608", found.mean(axis=0), between(0.85, 1.15))


def test_the_rear_wheels_meet_the_front_wheels_road() -> None:
    record = ride("C", 12.0)
    delay = (parameter("Body.CogToFront") + parameter("Body.CogToRear")) / SPEED
    t, late = record.t[2000:], record.t[2000:] - delay
    similar = []
    for front, rear in (("FL", "RL"), ("FR", "RR")):
        before = np.interp(late, record.t, record[f"Car.zRoad{front}"])
        similar.append(float(np.corrcoef(before, record[f"Car.zRoad{rear}"][2000:])[0, 1]))
    assert len(t) > 2000
    check = "class C: rear contact heights and the front ones a wheelbase earlier, correlation [-]"
    gate(SECTION, check, "1: the same surface", similar, at_least(0.995))


@pytest.mark.validation
def test_picture_of_spectra(plots: Path) -> None:
    caption = (
        "Displacement spectra at the FMU's four contact points, the patch's averaging taken out; "
        "dashed: the classes' means of ISO 8608."
    )
    with picture(plots, SECTION, "road_spectra", caption, figsize=(6, 4)) as (_, ax):
        for k, kind in enumerate("ABCD"):
            n, power = densities(ride(kind, 120.0))
            at, values = log_bands(n, power, 0.02, 8.0, 60)
            ax.loglog(at, values, f"C{k}", lw=0.8)
            mean = ROUGHNESS[kind] * (at / 0.1) ** -2.0
            ax.loglog(at, mean, "k--", lw=0.9)
            ax.text(8.5, mean[-1], f"class {kind}", color=f"C{k}", va="center")
        ax.set_xlim(0.02, 20.0)
        ax.set_xlabel("spatial frequency, 1/m")
        ax.set_ylabel("displacement spectrum, m³")
