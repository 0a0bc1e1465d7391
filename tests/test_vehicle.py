"""The vehicle block: what it reads, what it holds, and what it says when the FMU goes wrong."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from foreign_fmu import ECHO, Map, Variable, own_variables, parrot, report

from cosim.errors import FmuError
from cosim.fmi import Description, Value
from cosim.quantities import (
    CHANNEL_QUANTITIES,
    DAMPERS,
    OUTPUT_QUANTITIES,
    POSE,
    RECORDED,
    TRUTH,
)
from cosim.vehicle import Vehicle, builtin_fmu
from cosim.wiring import mapped_wiring, own_wiring

Array = npt.NDArray[np.float64]

H = 0.01
STANDING = np.zeros(3), np.zeros(4)


def builtin(start: dict[str, Value] | None = None, version: int = 3) -> Vehicle:
    return connected(Vehicle(Description(builtin_fmu(version)), own_wiring(), start or {}, H))


def connected(vehicle: Vehicle) -> Vehicle:
    vehicle.connect()
    return vehicle


def told(folder: Path, **orders: float) -> Vehicle:
    """A parrot with these orders (see tests/parrot_fmu)."""
    path = parrot(folder / "parrot.fmu")
    start: dict[str, Value] = {f"Parrot.{name}": value for name, value in orders.items()}
    return connected(Vehicle(Description(path), own_wiring(), start, H))


def echoing(folder: Path, initial_command: float = 0.0, damper_unit: str = "1") -> Vehicle:
    """A parrot whose first seven channels are its seven inputs."""
    own = own_variables() | {f"Echo.{i}": Variable(f"Echo.{i}", ECHO + i) for i in range(7)}
    for quantity in DAMPERS:
        own[quantity.variable] = replace(own[quantity.variable], unit=damper_unit)
    path = parrot(folder / "echo.fmu", tuple(own.values()))
    mapping = {CHANNEL_QUANTITIES[i].name: Map(f"Echo.{i}") for i in range(7)}
    wiring, problems = mapped_wiring(Description(path), mapping, report)
    assert not problems
    return connected(Vehicle(Description(path), wiring, {}, H, initial_command))


@pytest.mark.parametrize("version", [2, 3])
def test_the_car_starts_where_and_as_fast_as_it_is_told(version: int) -> None:
    start: dict[str, Value] = {
        "Init.x": 3.0, "Init.y": -2.0, "Init.Yaw": 0.5, "Init.Velocity": 20.0,
    }  # fmt: skip
    vehicle = builtin(start, version)
    state = vehicle.read()
    assert state.pose.tolist() == pytest.approx([3.0, -2.0, 0.5], abs=1e-9)
    assert state.channels[6] == pytest.approx(20.0)
    assert state.channels[9:13] == pytest.approx(np.full(4, 20.0), rel=0.05)
    np.testing.assert_allclose(state.truth, 0.0, atol=1e-9)
    vehicle.stop()


def test_shapes_and_order_of_the_state(tmp_path: Path) -> None:
    vehicle = told(tmp_path)
    state = vehicle.read()
    said = [sign * (i + 1.0) for i, sign in enumerate(q.scale for q in OUTPUT_QUANTITIES)]
    n, m = len(CHANNEL_QUANTITIES), len(CHANNEL_QUANTITIES) + len(TRUTH)
    assert state.channels.tolist() == said[:n]
    assert state.truth.tolist() == said[n:m]
    assert state.pose.tolist() == said[m : m + len(POSE)]
    assert state.recorded.tolist() == said[m:]
    assert len(state.recorded) == len(RECORDED)
    assert RECORDED[: len(POSE)] == POSE
    vehicle.stop()


def test_one_state_is_refilled_at_every_sample(tmp_path: Path) -> None:
    vehicle = told(tmp_path)
    state = vehicle.read()
    first = state.channels.copy()
    vehicle.write(*STANDING)
    vehicle.step(0)
    np.testing.assert_array_equal(state.channels, first)  # not before it is read
    assert vehicle.read() is state
    np.testing.assert_array_equal(state.channels, first + 1)
    vehicle.stop()


def test_commands_are_held_as_they_were_given(tmp_path: Path) -> None:
    vehicle = echoing(tmp_path)
    driver, dampers = np.array([0.1, 0.2, 0.3]), np.array([0.4, 0.5, 0.6, 0.7])
    vehicle.write(driver, dampers)
    vehicle.step(0)
    driver[:], dampers[:] = 9.0, 9.0
    assert vehicle.read().channels[:7].tolist() == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
    vehicle.stop()


@pytest.mark.parametrize(("unit", "told"), [("1", 0.25), ("%", 25.0), ("% lifted", 75.0)])
def test_dampers_begin_with_the_initial_command(tmp_path: Path, unit: str, told: float) -> None:
    vehicle = echoing(tmp_path, initial_command=0.25, damper_unit=unit)
    assert vehicle.read().channels[:7].tolist() == pytest.approx([0.0] * 3 + [told] * 4)
    vehicle.stop()


def test_a_number_that_is_none_is_named_with_time_and_last_inputs(tmp_path: Path) -> None:
    """Output 2 is Car.az; it is NaN from the fourth sample on."""
    vehicle = told(tmp_path, BadAt=3, BadOutput=102)
    for k in range(3):
        vehicle.read()
        vehicle.write(np.array([0.1, 0.25 * k, 0.0]), np.full(4, 0.5))
        vehicle.step(k)
    with pytest.raises(FmuError) as caught:
        vehicle.read()
    message = str(caught.value)
    assert message.startswith("parrot.fmu: Car.az is nan at t = 0.03 s; the last inputs were ")
    assert "DM.Steer.Ang = 0.1, DM.Gas = 0.5, DM.Brake = 0" in message
    assert "Car.SuspControl.DamperRR.CtrlOut = 0.5" in message
    vehicle.stop()


def test_infinities_of_both_signs(tmp_path: Path) -> None:
    vehicle = told(tmp_path, BadAt=1, BadOutput=102, BadValue=1)
    vehicle.write(*STANDING)
    vehicle.step(0)
    with pytest.raises(FmuError, match=r"Car\.az is inf at t = 0\.01 s"):
        vehicle.read()
    vehicle.stop()


def test_a_missing_road_file_is_named_in_the_fmus_own_words(tmp_path: Path) -> None:
    with pytest.raises(FmuError, match=r"vehicle\.fmi3\.fmu: .*gone\.crg"):
        builtin({"Road.File": str(tmp_path / "gone.crg")})


def test_a_road_file_that_is_none(tmp_path: Path) -> None:
    path = tmp_path / "road.crg"
    path.write_text("no road\n")
    with pytest.raises(FmuError, match=r"vehicle\.fmi3\.fmu: .*road\.crg"):
        builtin({"Road.File": str(path)})


@pytest.mark.parametrize("version", [2, 3])
def test_parameters_that_only_the_fmu_can_judge(version: int) -> None:
    """Both are within their ranges, but not together."""
    with pytest.raises(FmuError, match=r"Body\.UnsprungMass = 900 kg .*Body\.Mass = 600 kg"):
        builtin({"Body.UnsprungMass": 900.0, "Body.Mass": 600.0}, version)


def test_a_command_that_is_no_number_is_named() -> None:
    vehicle = builtin()
    vehicle.write(np.array([0.0, np.nan, 0.0]), np.zeros(4))
    with pytest.raises(FmuError, match=r"could not .*DM\.Gas cannot be set to nan"):
        vehicle.step(0)
    vehicle.stop()


def test_a_vehicle_that_does_not_start_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    with pytest.raises(FmuError):
        builtin({"Body.Mass": 0.0})
    assert not list(scratch.iterdir())
    vehicle = builtin()
    assert list(scratch.iterdir())
    vehicle.stop()
    vehicle.stop()
    assert not list(scratch.iterdir())
    Vehicle(Description(builtin_fmu()), own_wiring(), {}, H).stop()  # which never was connected


def test_an_fmu_that_was_never_built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cosim.vehicle.resources.files", lambda package: tmp_path)
    with pytest.raises(FmuError, match=r"vehicle\.fmi2\.fmu: missing; build it with") as caught:
        builtin_fmu(2)
    assert caught.value.exit_code == 3


def test_a_friction_given_as_a_start_value_lasts() -> None:
    """Road.Friction is an input that nobody writes: it keeps its start value over the run."""
    slowing = {}
    for friction in (1.0, 0.1):
        vehicle = builtin({"Road.Friction": friction, "Init.Velocity": 20.0})
        for k in range(100):
            vehicle.write(np.array([0.0, 0.0, 0.6]), np.zeros(4))
            vehicle.step(k)
        slowing[friction] = 20.0 - float(vehicle.read().channels[6])
        vehicle.stop()
    assert slowing[0.1] < 0.12 * 9.81  # within one second, some drag included
    assert slowing[1.0] > 4.0
