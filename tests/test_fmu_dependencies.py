"""ModelStructure of the vehicle FMUs: what outputs depend on is measured.

Every variable that can be set is moved, in several situations, and the outputs that follow by more
than rounding are compared with those that the model description lists for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import shipped_fmus as fmus
from vehicle_rig import INPUTS, cosine_bump, each, output_names, straight_road

from cosim.fmi import Description, Slave, Value
from cosim.vehicle import builtin_fmu

Array = npt.NDArray[np.float64]
Start = dict[str, Value]
KNOWNS = [
    v
    for v in fmus.variables(fmus.Shipped("vehicle", 3)).values()
    if v.causality in ("input", "parameter")
]


def listed(version: int, what: str) -> dict[str, set[str]]:
    """Dependencies by output, from the XML; every output has them."""
    unknowns = getattr(fmus.description(fmus.Shipped("vehicle", version)), what)
    assert all(unknown.dependencies is not None for unknown in unknowns)
    return {u.variable.name: {v.name for v in u.dependencies} for u in unknowns}


class Starts:
    """One instance of the vehicle that is initialised again and again."""

    def __init__(self) -> None:
        self.slave = Slave(Description(builtin_fmu(3)), [], output_names())
        self.fmu: Any = self.slave._fmu

    def outputs(self, start: Start, time: float = 0.0) -> Array | None:
        """Outputs at the start; None if there is no equilibrium."""
        self.fmu.reset()
        for name, value in start.items():
            self.slave._set(name, value)
        self.fmu.enterInitializationMode(startTime=time)
        try:
            self.fmu.exitInitializationMode()
        except Exception:
            return None
        self.slave.read()
        return self.slave.outputs.copy()


@pytest.fixture(scope="module")
def starts() -> Iterator[Starts]:
    made = Starts()
    yield made
    made.slave.close()


@pytest.fixture(scope="module")
def roads(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    folder = tmp_path_factory.mktemp("roads")

    def bump(s: Array, v: Array) -> Array:
        return cosine_bump(s, 2.0, 4.0, 0.06) + 0.01 * v

    def even(s: Array, v: Array) -> Array:
        return 0.0 * s + 0.0 * v

    return (
        straight_road(folder / "bump.crg", bump),
        straight_road(folder / "slope.crg", even, grade=0.06),
    )


@pytest.fixture(scope="module")
def situations(roads: tuple[str, str]) -> list[Start]:
    """Standing, driving, on a bump across the car, on a slope, on ice with passive dampers."""
    turning: Start = {"DM.Steer.Ang": 0.5, "DM.Gas": 0.3, "DM.Brake": 0.2}
    odd: Start = {
        "Sensor.Imu.Cutoff": 20.0, "Sensor.Imu.X": 0.3, "Sensor.Imu.Roll": 0.02,
        "Sensor.Imu.Pitch": 0.05, "Sensor.Imu.Yaw": -0.04, **each("Wheel.Imbalance@", 0.01),
    }  # fmt: skip
    ice: Start = {
        "Road.Friction": 0.2, "Damp.Passive": True, "SlipControl.Active": False,
        "Tire.LoadDependentRadius": False, "DM.Steer.Ang": -1.0,
    }  # fmt: skip
    return [
        {},
        {**turning, **odd, "Init.Velocity": 20.0, "Init.Yaw": 0.3, "Init.y": 1.0},
        {**odd, "Road.File": roads[0], "Init.x": 3.0, "Init.y": 0.3, "Init.Velocity": 5.0},
        {**odd, "Road.File": roads[1], "Init.x": 20.0, "DM.Brake": 0.5, "DM.Steer.Ang": 0.2},
        {**ice, "Init.Velocity": 40.0},
    ]


def neighbours(variable: Any, value: Value | None, roads: tuple[str, str]) -> list[Value]:
    """Other values of a variable, near and far, within its limits."""
    if variable.type == "Boolean":
        return [not (variable.start == "true" if value is None else value)]
    if variable.type == "String":
        return [road for road in ("", *roads) if road != (value or "")]
    here = float(variable.start if value is None else value)
    low = float(variable.min) if variable.min is not None else -np.inf
    high = float(variable.max) if variable.max is not None else np.inf
    step = max(0.02 * abs(here), 1e-7)
    moved = (here + step, here - step, 1.2 * here + 0.01)
    return [x for x in moved if low <= x <= high]


@pytest.fixture(scope="module")
def measured(
    starts: Starts, situations: list[Start], roads: tuple[str, str]
) -> dict[str, set[str]]:
    """By output every variable that has moved it at the start."""
    moved: dict[str, set[str]] = {name: set() for name in output_names()}
    tried = 0
    for situation in situations:
        base = starts.outputs(situation)
        assert base is not None
        for variable in KNOWNS:
            for value in neighbours(variable, situation.get(variable.name), roads):
                outputs = starts.outputs({**situation, variable.name: value})
                if outputs is not None:
                    tried += 1
                    rounding = 8.0 * np.finfo(float).eps * np.maximum(np.abs(base), 1.0)
                    for i in np.flatnonzero(np.abs(outputs - base) > rounding):
                        moved[output_names()[i]].add(variable.name)
    assert tried > 10 * len(KNOWNS)
    return moved


def test_both_versions_list_the_same() -> None:
    for what in ("outputs", "initialUnknowns"):
        assert listed(2, what) == listed(3, what)
        assert set(listed(3, what)) == set(output_names())


def test_no_output_follows_an_input_at_a_communication_point() -> None:
    """Outputs stay while inputs are set, all at once and one by one; the next step shows each."""
    assert set().union(*listed(3, "outputs").values()) == set()
    for version in fmus.VERSIONS:
        slave = Slave(Description(builtin_fmu(version)), INPUTS, output_names())
        slave.inputs[:] = [0.2, 0.4, 0.0, 1.0, 0.3, 0.4, 0.5, 0.6]
        slave.initialise({"Init.Velocity": 15.0})
        for k in range(20):
            slave.step(k, 0.01)
        slave.read()
        before, held = slave.outputs.copy(), slave.inputs.copy()
        state = slave._fmu.getFMUState()
        slave.step(20, 0.01)
        slave.read()
        after = slave.outputs.copy()
        for changed in [[i] for i in range(len(INPUTS))] + [list(range(len(INPUTS)))]:
            slave._fmu.setFMUState(state)
            slave.inputs[:] = held
            slave.inputs[changed] = held[changed] * 0.8 + 0.05
            slave._set_inputs()
            slave.read()
            np.testing.assert_array_equal(slave.outputs, before)
            slave.step(20, 0.01)
            slave.read()
            assert np.any(slave.outputs != after), [INPUTS[i] for i in changed]
        slave._fmu.freeFMUState(state)
        slave.close()


def test_no_output_moves_that_is_not_listed(measured: dict[str, set[str]]) -> None:
    said = listed(3, "initialUnknowns")
    missing = {o: sorted(by - said[o]) for o, by in measured.items() if by - said[o]}
    assert missing == {}


def test_an_input_that_is_listed_moves_an_output(measured: dict[str, set[str]]) -> None:
    """So no importer sees a loop over the FMU at the start that is none."""
    said = listed(3, "initialUnknowns")
    idle = {
        o: sorted((said[o] & set(INPUTS)) - by)
        for o, by in measured.items()
        if (said[o] & set(INPUTS)) - by
    }
    assert idle == {}


def test_channels_and_damper_commands_form_no_loop_at_the_start() -> None:
    """A suspension controller need not be iterated with the vehicle."""
    said = listed(3, "initialUnknowns")
    commands = {name for name in INPUTS if "Damper" in name}
    assert {o for o, on in said.items() if on & commands} == {
        f"Car.Damp{corner}.Ctrl" for corner in ("FL", "FR", "RL", "RR")
    }


def test_the_start_time_moves_no_output(starts: Starts, situations: list[Start]) -> None:
    for situation in situations:
        first, later = starts.outputs(situation), starts.outputs(situation, time=1234.5)
        assert first is not None
        assert later is not None
        np.testing.assert_array_equal(first, later)
