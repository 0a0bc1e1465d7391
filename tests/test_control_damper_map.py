"""The dampers' map: the vehicle's own force, and the command for a force."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.control.damper_map import DamperMap, damper_map
from cosim.fmi import Description, Slave, Value
from cosim.road import Bumps, Smooth, build_road, load_track
from cosim.vehicle import builtin_fmu

Array = npt.NDArray[np.float64]

H = 0.01
MAP = DamperMap()
CORNERS = ("FL", "FR", "RL", "RR")
SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0)

speeds = st.floats(-3.0, 3.0)
forces = st.floats(-1e4, 1e4)
wheels = st.integers(0, 3)


@given(wheels, speeds, st.floats(0, 1))
def test_a_damper_only_resists(wheel: int, v: float, command: float) -> None:
    assert MAP.force(wheel, v, command) * v >= 0.0


@given(wheels, forces, speeds)
def test_the_command_is_the_nearest_that_there_is(wheel: int, wanted: float, v: float) -> None:
    """Against a search over all commands; soft where the force would push along the motion."""
    command = MAP.command(wheel, wanted, v)
    assert 0.0 <= command <= 1.0
    if wanted * v <= 0.0:
        assert command == 0.0
        return
    ends = np.array([MAP.force(wheel, v, 0.0), MAP.force(wheel, v, 1.0)])
    reachable = ends[0] + np.linspace(0.0, 1.0, 1001) * (ends[1] - ends[0])
    least = np.abs(reachable - wanted).min()
    assert abs(MAP.force(wheel, v, command) - wanted) <= least + 2.0


def test_the_damper_at_rest_is_soft() -> None:
    """Where soft and hard are the same force, no command is better than another."""
    assert MAP.command(0, 1000.0, 1e-6) == 0.0


def test_another_cars_dampers() -> None:
    own = damper_map({"Damp.HardRebound1": 500, "Damp.ScaleRL": 2.0, "Body.Mass": 2000.0})
    assert own.force(0, 0.05, 1.0) == pytest.approx(500.0)
    assert own.force(0, 0.05, 0.0) == MAP.force(0, 0.05, 0.0)
    assert own.force(2, -0.1, 0.5) == pytest.approx(2.0 / 1.33 * MAP.force(2, -0.1, 0.5))
    assert own.force(3, -0.1, 0.5) == MAP.force(3, -0.1, 0.5)


def parameter(name: str) -> float:
    return float(Description(builtin_fmu()).variables[name].start)


@pytest.mark.parametrize("end", ["soft", "hard"])
@pytest.mark.parametrize("way", ["rebound", "compression"])
def test_the_map_goes_through_the_fmus_table(end: str, way: str) -> None:
    variables = Description(builtin_fmu()).variables
    sign, command = 1.0 if way == "rebound" else -1.0, float(end == "hard")
    names = [name for name in variables if name.startswith(f"Damp.{end.title()}{way.title()}")]
    assert len(names) == len(SPEEDS)
    for name in names:
        stated = re.search(r"at ([\d.]+) m/s", variables[name].description)
        assert stated is not None
        speed, force = float(stated[1]), float(variables[name].start)
        assert MAP.force(0, sign * speed, command) == pytest.approx(sign * force)


def test_the_scales_are_the_fmus_default() -> None:
    assert [parameter(f"Damp.Scale{corner}") for corner in CORNERS] == list(MAP.tables.scale)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[float, tuple[Array, Array]]:
    """Command to suspension velocities and wheel forces of the FMU, (samples, 4) each."""
    folder = tmp_path_factory.mktemp("road")
    road = build_road(load_track("straight", 300.0), Smooth(), folder, [Bumps(0.06, 1.2, 7.0)])
    ratio = np.array([parameter(f"Damp.MotionRatio{corner}") for corner in CORNERS])
    outputs = [f"Car.C{c}.q0p" for c in CORNERS] + [f"Car.Damp{c}.Frc" for c in CORNERS]
    inputs = [f"Car.SuspControl.Damper{c}.CtrlOut" for c in CORNERS]
    start: dict[str, Value] = {"Road.File": str(road), "Init.Velocity": 14.0}
    found = {}
    for command in (0.0, 0.5, 1.0):
        slave = Slave(Description(builtin_fmu()), inputs, outputs)
        slave.inputs[:] = command
        slave.initialise(start)
        rows = []
        for k in range(1500):
            slave.step(k, H)
            slave.read()
            rows.append(slave.outputs.copy())
        slave.close()
        values = np.array(rows)
        found[command] = (-values[:, :4], values[:, 4:] * ratio)
    return found


@pytest.mark.parametrize("command", [0.0, 0.5, 1.0])
def test_the_force_is_the_fmus(measured: dict[float, tuple[Array, Array]], command: float) -> None:
    velocity, wheel_force = measured[command]
    assert np.abs(velocity).max() > 0.5
    for corner in range(4):
        expected = [MAP.force(corner, v, command) for v in velocity[:, corner].tolist()]
        np.testing.assert_allclose(wheel_force[:, corner], expected, rtol=1e-6, atol=0.1)
