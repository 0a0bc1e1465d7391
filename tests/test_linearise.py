"""The linear vehicle: what it says of small motions is what the FMU then does."""

from __future__ import annotations

import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy import signal
from vehicle_rig import (
    CORNERS,
    DAMPERS,
    INPUTS,
    NO_DRAG,
    STEER,
    Rig,
    cosine_bump,
    description,
    linear_dampers,
    run,
    straight_road,
)

from cosim.errors import FmuError
from cosim.fmi import Description, Value
from cosim.linearise import LinearModel, linearise, linearise_on_road
from cosim.linearise.state import TABLE

SPEED, H = 15.0, 0.001
START: dict[str, Value] = {"Init.Velocity": SPEED, **NO_DRAG, **linear_dampers(2450.0, 3250.0)}
HELD = {"DM.Steer.Ang": 0.0, "DM.Gas": 0.0}
OUTPUTS = ("Car.az", "Car.ay", "Car.YawRate", "Car.vFL", *(f"Car.C{c}.q0p" for c in CORNERS))
# coordinates that nothing depends on, and brakes that are open
IDLE = (
    *("position.x", "position.y", "attitude.z", "angle", "brake_torque", "brake_windup"),
    *("imu", "imu_rate", "dissipated", "supplied"),
)


@cache
def model() -> LinearModel:
    return linearise_on_road(description(), START, HELD, OUTPUTS).without_states(IDLE)


def test_names_and_shapes() -> None:
    m = model()
    n, inputs = len(m.states), len(m.inputs)
    assert (m.A.shape, m.B.shape) == ((n, n), (n, inputs))
    assert (m.C.shape, m.D.shape) == ((len(OUTPUTS), n), (len(OUTPUTS), inputs))
    assert m.inputs[:3] == ("DM.Steer.Ang", "DM.Gas", "Road.z.FL")
    assert {"position.z", "attitude.x", "attitude.y", "travel.RR", "stretch_x.FL"} <= set(m.states)
    assert not {"position.x", "attitude.z", "spin"} & set(m.states)


def test_what_follows_by_definition() -> None:
    m = model()
    for c in CORNERS:
        row = m.A[m.states.index(f"travel.{c}")]
        expected = np.array([s == f"travel_rate.{c}" for s in m.states], dtype=float)
        assert row == pytest.approx(expected, abs=1e-6)
        valve = m.states.index(f"valve.{c}")
        assert m.A[valve, valve] == pytest.approx(-1.0 / 0.012, rel=1e-6)
    assert np.linalg.eigvals(m.A).real.max() < 0.01  # a car that goes straight on


def test_idle_coordinates_are_idle() -> None:
    whole = linearise(description(), START, HELD, OUTPUTS)
    for name in ("position.x", "position.y", "angle.FL", "imu.3", "supplied"):
        column = whole.states.index(name)
        others = np.arange(len(whole.states)) != column
        assert np.abs(whole.A[others, column]).max() < 1e-3, name
        assert np.abs(whole.C[:, column]).max() < 1e-9, name


@pytest.mark.parametrize("version", [2, 3])
def test_both_fmi_versions_give_the_same(version: int) -> None:
    m = linearise(description(version), START, HELD, OUTPUTS).without_states(IDLE)
    assert np.array_equal(
        m.A, linearise(description(), START, HELD, OUTPUTS).without_states(IDLE).A
    )


def test_a_small_turn_of_the_hand_wheel() -> None:
    m, angle = model(), 1e-3
    first = [m.inputs.index("DM.Steer.Ang")]

    def steer(rig: Rig) -> None:
        rig.inputs[STEER] = angle

    record, straight = run(1.0, START, steer, h=H), run(1.0, START, h=H)
    system = signal.StateSpace(m.A, m.B[:, first], m.C, m.D[:, first])
    _, y, _ = signal.lsim(system, np.full(len(record.t), angle), record.t)
    for name in ("Car.YawRate", "Car.ay"):
        change = record[name] - straight[name]
        predicted = y[:, OUTPUTS.index(name)]
        assert np.abs(predicted - change)[5:].max() < 0.005 * np.abs(change).max(), name


def test_a_small_bump_under_the_left_wheels(tmp_path: Path) -> None:
    """The wheels' own elevation, as the FMU reports it, into the linear model."""
    columns = np.array([-4.5, -0.1, 0.1, 4.5])
    road = straight_road(
        tmp_path / "bump.crg",
        lambda s, v: cosine_bump(s, 5.0, 2.0, 0.001) * (v > 0.0),
        columns=columns,
    )
    record, flat = run(1.2, {**START, "Road.File": road}, h=H), run(1.2, START, h=H)
    m = model().driven_over_elevation(SPEED)
    elevation = record.corners("Car.zRoad@")
    u = np.zeros((len(record.t), len(m.inputs)))
    u[:, 2:] = np.gradient(elevation, H, axis=0)
    _, y, _ = signal.lsim(signal.StateSpace(m.A, m.B, m.C, m.D), u, record.t)
    for name in ("Car.az", "Car.vFL", *(f"Car.C{c}.q0p" for c in CORNERS)):
        change = record[name] - flat[name]
        error = np.abs(y[:, OUTPUTS.index(name)] - change).max() / np.abs(change).max()
        assert error < 0.01, name


def test_samples() -> None:
    m = model()
    A, B = m.discretise(0.01)
    exact = signal.cont2discrete((m.A, m.B, m.C, m.D), 0.01)
    assert pytest.approx(exact[0], abs=1e-9) == A
    assert pytest.approx(exact[1], rel=1e-6, abs=1e-9) == B


def test_dampers_count_at_their_operating_point() -> None:
    """Soft dampers leave less damping than hard ones."""

    def real_part(command: float) -> float:
        commands = dict.fromkeys(INPUTS[DAMPERS], command)
        m = linearise(description(), {"Init.Velocity": SPEED}, commands, ("Car.az",))
        rate = m.states.index("travel_rate.FL")
        return float(m.A[rate, rate])

    assert real_part(1.0) < 2.0 * real_part(0.0) < 0.0


def test_an_fmu_that_does_not_tell_its_state(tmp_path: Path) -> None:
    path = tmp_path / "silent.fmu"
    with zipfile.ZipFile(description().path) as own, zipfile.ZipFile(path, "w") as other:
        for name in own.namelist():
            if name != TABLE:
                other.writestr(name, own.read(name))
    with pytest.raises(FmuError, match=r"silent\.fmu: has no extra/.*states\.json"):
        linearise(Description(path), START, HELD, OUTPUTS)
