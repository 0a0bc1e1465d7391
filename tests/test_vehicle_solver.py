"""The integration step: what the true suspension velocities lose at the default step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from gates import at_least, at_most, gate
from vehicle_rig import (
    BRAKE,
    DAMPERS,
    GAS,
    STEER,
    Array,
    Drive,
    Record,
    Rig,
    parameter,
    run,
    straight_track,
)

from cosim.fmi import Value
from cosim.road import Bumps, Cobbles, Iso8608, Smooth, build_road

DEFAULT = parameter("Solver.Step")
REFERENCE, HALF = 6.25e-5, 0.5 * DEFAULT  # [s]
RATES = np.array([1.0, 1.3, 1.7, 2.1])  # of the four damper commands [Hz]
REFERENCE_NAME = f"{1e3 * REFERENCE:g} ms against the default {1e3 * DEFAULT:g} ms"
LEAD = 100  # samples before the road begins


def drive(rig: Rig) -> None:
    """A slalom with pedals and moving dampers."""
    rig.inputs[STEER] = 0.8 * np.sin(np.pi * rig.t)
    rig.inputs[GAS] = 0.15 if rig.t < 3.0 else 0.03
    rig.inputs[BRAKE] = 0.15 if rig.t > 4.0 else 0.0
    rig.inputs[DAMPERS] = 0.5 + 0.5 * np.sin(2.0 * np.pi * RATES * rig.t)


def dampers(rig: Rig) -> None:
    """Straight on, with moving dampers."""
    rig.inputs[GAS] = 0.03
    rig.inputs[DAMPERS] = 0.5 + 0.5 * np.sin(2.0 * np.pi * RATES * rig.t)


def errors(
    road: str, kmh: float, seconds: float, command: Drive, step: float, exact: float = REFERENCE
) -> Array:
    """Rms of the error over rms of the truth, the four suspension velocities, shape (4,); the truth
    is the run at the step `exact` [s].
    """

    def at(one: float) -> Array:
        start: dict[str, Value] = {
            "Init.Velocity": kmh / 3.6,
            "Road.File": road,
            "Solver.Step": one,
        }
        record: Record = run(seconds, start, command)
        return record.corners("Car.C@.q0p")[LEAD:]

    truth = at(exact)
    off = at(step) - truth
    return np.asarray(np.sqrt((off**2).mean(axis=0) / (truth**2).mean(axis=0)))


Roads = Callable[[str], str]


@pytest.fixture(scope="module")
def roads(tmp_path_factory: pytest.TempPathFactory) -> Roads:
    folder = tmp_path_factory.mktemp("solver")
    track = straight_track(120.0)
    bumps = [Bumps(0.05, 2.0, 5.0)]
    files = {
        "class C": lambda: build_road(track, Iso8608("C", 3), folder),
        "bumps": lambda: build_road(track, Smooth(), folder, bumps),
        "cobblestones": lambda: build_road(track, Cobbles(3), folder),
    }
    return lambda name: str(files[name]())


def enter(
    roads: Roads, road: str, kmh: float, seconds: float, command: Drive, most: float = 0.01
) -> Array:
    at_default = errors(roads(road), kmh, seconds, command, DEFAULT)
    how = "driven" if command is drive else "straight on"
    check = f"{road} at {kmh:g} km/h, {how}: suspension velocities, error over rms [-]"
    gate("Solver", check, REFERENCE_NAME, at_default, at_most(most))
    return at_default


def test_class_c_driven(roads: Roads) -> None:
    enter(roads, "class C", 50.0, 6.0, drive)


@pytest.mark.parametrize("kmh", [15.0, 32.0])
def test_bumps(roads: Roads, kmh: float) -> None:
    """0.05 m high, 2 m long, left and right in turn."""
    enter(roads, "bumps", kmh, 6.0, dampers)


@pytest.mark.validation
@pytest.mark.parametrize(("road", "kmh", "most"), [("class C", 80.0, 0.015), ("bumps", 25.0, 0.01)])
def test_other_speeds(roads: Roads, road: str, kmh: float, most: float) -> None:
    enter(roads, road, kmh, 4.0, dampers, most)


@pytest.mark.validation
def test_cobblestones(roads: Roads) -> None:
    """Wheels that hop off the ground ask more of any step."""
    found = errors(roads("cobblestones"), 40.0, 6.0, dampers, DEFAULT)
    check = "cobblestones at 40 km/h: suspension velocities, error over rms [-]"
    gate("Solver", check, REFERENCE_NAME, found, at_most(0.03))


@pytest.mark.validation
def test_halving_the_step_quarters_the_error(roads: Roads) -> None:
    whole, half = (errors(roads("class C"), 50.0, 6.0, drive, s) for s in (DEFAULT, HALF))
    check = "class C at 50 km/h, driven: error over that at half the step [-]"
    gate("Solver", check, "4: second order", whole / half, at_least(3.0))


@pytest.mark.validation
@pytest.mark.parametrize(("kmh", "most"), [(50.0, 0.01), (80.0, 0.011)])
def test_halving_the_step_changes_little(roads: Roads, kmh: float, most: float) -> None:
    changed = errors(roads("class C"), kmh, 4.0, dampers, DEFAULT, HALF)
    check = f"class C at {kmh:g} km/h, straight on: change by halving the step, over rms [-]"
    gate("Solver", check, "the default step halved", changed, at_most(most))
