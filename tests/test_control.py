"""The dampers' commands: fixed, switching at random, and skyhook on the FMU's own damper map."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt
import pytest

from cosim.control.damper_map import DamperMap
from cosim.control.fixed import FixedDampers
from cosim.control.sample import Sample
from cosim.control.skyhook import Skyhook
from cosim.control.switching import SwitchingDampers
from cosim.fmi import Description, Slave, Value
from cosim.road import Bumps, Smooth, build_road, load_track
from cosim.vehicle import builtin_fmu
from sensor.body_motion import BodyMotion

Array = npt.NDArray[np.float64]

H = 0.01
MAP = DamperMap()
CORNERS = ("FL", "FR", "RL", "RR")


def sample(
    measured: Array | None = None,
    estimate: Array | None = None,
    valid: bool = False,
    truth: Array | None = None,
) -> Sample:
    """What is known of a car that stands still, but for what is given."""
    nan = np.full(4, np.nan)
    return Sample().renewed(
        np.zeros(14) if measured is None else measured,
        nan if estimate is None else estimate,
        nan,
        valid,
        np.zeros(4) if truth is None else truth,
    )


class Known(BodyMotion):
    """A body whose corners move as they are told."""

    def __init__(self, *velocity: float) -> None:
        super().__init__()
        self.velocity = np.array(velocity)

    def step(self, measured: object) -> Array:
        return self.velocity


def force(velocity: float, command: float, corner: int = 0) -> float:
    """What a corner's damper does at the wheel [N]: straight between the points, and beyond."""
    way = "rebound" if velocity >= 0 else "compression"
    ends: list[float] = []
    for table in (getattr(MAP, f"soft_{way}"), getattr(MAP, f"hard_{way}")):
        slope = float(table[-1] - table[-2]) / (MAP.speed[-1] - MAP.speed[-2])
        beyond = max(abs(velocity) - MAP.speed[-1], 0.0) * slope
        ends.append(float(np.interp(abs(velocity), MAP.speed, table)) + beyond)
    sign = 1.0 if velocity >= 0 else -1.0
    soft, hard = ends
    return sign * MAP.scale[corner] * (soft + command * (hard - soft))


# ---------------------------------------------------------------- fixed and switching


@pytest.mark.parametrize("command", [0.0, 0.4, 1.0])
def test_fixed_dampers_stay(command: float) -> None:
    dampers = FixedDampers(command)
    for _ in range(3):
        assert dampers.step(sample()).tolist() == [command] * 4


def switched(seed: int, samples: int = 20_000) -> Array:
    """Commands (samples, 4) of 200 s."""
    dampers = SwitchingDampers(seed, H)
    return np.array([dampers.step(sample()).copy() for _ in range(samples)])


def test_switching_is_given_by_the_seed_alone() -> None:
    np.testing.assert_array_equal(switched(3), switched(3))
    assert not np.array_equal(switched(3), switched(4))


def test_switching_covers_the_whole_range_and_both_ends() -> None:
    commands = switched(1)
    assert commands.min() == 0.0
    assert commands.max() == 1.0
    for column in commands.T:
        shares = [(column == 0.0).mean(), (column == 1.0).mean()]
        assert min(shares) > 0.15
        assert max(shares) < 0.35
        inner = column[(column > 0.0) & (column < 1.0)]
        assert 0.3 < len(inner) / len(column) < 0.7
        assert inner.mean() == pytest.approx(0.5, abs=0.06)


def test_switching_holds_each_command_for_a_while() -> None:
    """0.05 s to 1 s; the same end may come twice in a row, so only inner values show it."""
    spans = []
    for column in switched(2).T:
        (changes,) = np.nonzero(np.diff(column))
        starts = np.concatenate([[0], changes + 1, [len(column)]])
        spans += [
            length
            for start, length in zip(starts[1:-1], np.diff(starts)[1:], strict=True)
            if 0.0 < column[start] < 1.0 and start + length < len(column)
        ]
    assert len(spans) > 100
    assert min(spans) >= 0.05 / H
    assert max(spans) <= 1.0 / H
    assert np.mean(spans) * H == pytest.approx(0.525, abs=0.06)


def test_dampers_switch_each_for_itself() -> None:
    commands = switched(1)
    correlation = np.corrcoef(commands.T) - np.eye(4)
    assert np.abs(correlation).max() < 0.25


# ---------------------------------------------------------------- skyhook


def command_for(body: Array, relative: Array, gain: float = 3500.0, on_truth: bool = True) -> Array:
    skyhook = Skyhook(on_truth, gain, body=Known(*body))
    nan = np.full(4, np.nan)
    known = sample(truth=relative) if on_truth else sample(None, relative, True, nan)
    return skyhook.step(known).copy()


@pytest.mark.parametrize("on_truth", [True, False], ids=["truth", "estimate"])
@pytest.mark.parametrize(("body", "relative"), [(0.2, -0.1), (-0.2, 0.1), (0.0, 0.1), (0.2, 0.0)])
def test_soft_where_the_damper_could_only_push_the_wrong_way(
    body: float, relative: float, on_truth: bool
) -> None:
    command = command_for(np.full(4, body), np.full(4, relative), on_truth=on_truth)
    assert command.tolist() == [0.0] * 4


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["up and out", "down and in"])
@pytest.mark.parametrize("on_truth", [True, False], ids=["truth", "estimate"])
@pytest.mark.parametrize("speed", [0.03, 0.1, 0.3, 0.8])
def test_the_force_is_the_skyhooks_where_the_damper_can_give_it(
    sign: float, on_truth: bool, speed: float
) -> None:
    gain = 3500.0
    wanted = sign * 0.5 * (abs(force(sign * speed, 0.0)) + abs(force(sign * speed, 1.0)))
    body = np.full(4, wanted / gain)
    command = command_for(body, np.full(4, sign * speed), gain, on_truth)
    for corner in range(4):
        if 0.0 < command[corner] < 1.0:
            assert force(sign * speed, command[corner], corner) == pytest.approx(wanted)
    assert command[:2] == pytest.approx(0.5)
    assert (command[2:] < 0.5).all()  # the rear dampers are stronger: less of them is enough


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_clipped_to_what_the_damper_has(sign: float) -> None:
    relative = np.full(4, sign * 0.2)
    assert command_for(np.full(4, sign * 5.0), relative).tolist() == [1.0] * 4
    assert command_for(np.full(4, sign * 1e-3), relative).tolist() == [0.0] * 4


def test_random_states_get_the_nearest_force_or_soft() -> None:
    """Against a search over all commands, corner by corner."""
    random = np.random.default_rng(5)
    candidates = np.linspace(0.0, 1.0, 2001)
    for _ in range(60):
        body, relative = random.normal(0, 0.3, 4), random.normal(0, 0.4, 4).clip(-1, 1)
        command = command_for(body, relative)
        for i in range(4):
            best = 0.0
            if body[i] * relative[i] > 0:
                ends = force(relative[i], 0.0, i), force(relative[i], 1.0, i)
                reachable = ends[0] + candidates * (ends[1] - ends[0])
                best = float(candidates[np.argmin(np.abs(reachable - 3500.0 * body[i]))])
            assert command[i] == pytest.approx(best, abs=1e-3)


def test_corners_are_commanded_each_for_itself() -> None:
    body, relative = np.array([0.3, -0.3, 0.3, -0.3]), np.array([0.2, 0.2, -0.2, -0.2])
    command = command_for(body, relative)
    assert (command > 0).tolist() == [True, False, False, True]


def test_the_damper_at_rest_is_soft() -> None:
    """Where soft and hard are the same force, no command is better than another."""
    assert command_for(np.full(4, 0.5), np.full(4, 1e-5)).tolist() == [0.0] * 4


def test_beyond_the_map_it_goes_on_straight() -> None:
    wanted = 0.5 * (force(2.0, 0.0) + force(2.0, 1.0))
    command = command_for(np.full(4, wanted / 3500.0), np.full(4, 2.0))
    assert command[:2] == pytest.approx(0.5)


def test_the_initial_command_is_held_until_an_estimate_is_valid() -> None:
    skyhook = Skyhook(False, initial=0.35, body=Known(0.5, 0.5, 0.5, 0.5))
    invalid = sample(truth=np.full(4, 0.3))
    for _ in range(20):
        assert skyhook.step(invalid).tolist() == [0.35] * 4
    valid = skyhook.step(sample(None, np.full(4, 0.3), True)).copy()
    assert (valid != 0.35).all()
    np.testing.assert_array_equal(skyhook.step(invalid), valid)  # the last one is the best guess


def test_the_truth_needs_no_valid_estimate() -> None:
    skyhook = Skyhook(True, initial=0.35, body=Known(5.0, 5.0, 5.0, 5.0))
    command = skyhook.step(sample(truth=np.full(4, 0.3)))
    assert command.tolist() == [1.0] * 4


def test_body_velocity_comes_from_the_channels_also_while_nothing_is_valid() -> None:
    """The filter behind it has settled when the first estimate arrives."""
    t = H * np.arange(300)
    measured = np.zeros((300, 14))
    measured[:, 2] = 2.0 * np.sin(2 * np.pi * 1.2 * t)
    body = BodyMotion().apply(measured)
    late, early = Skyhook(False), Skyhook(False)
    for k, row in enumerate(measured):
        relative = np.full(4, 0.2 * np.sign(body[k, 0]))
        one = late.step(sample(row, relative, k >= 100)).copy()
        other = early.step(sample(row, relative, True))
        if k >= 100:
            np.testing.assert_array_equal(one, other)
    assert one.max() > 0


# ---------------------------------------------------------------- the map and the FMU


def parameter(name: str) -> float:
    return float(Description(builtin_fmu()).variables[name].start)


@pytest.mark.parametrize("end", ["soft", "hard"])
@pytest.mark.parametrize("way", ["rebound", "compression"])
def test_the_map_is_the_fmus_default(end: str, way: str) -> None:
    variables = Description(builtin_fmu()).variables
    table = getattr(MAP, f"{end}_{way}")
    assert table[0] == MAP.speed[0] == 0.0
    names = [f"Damp.{end.title()}{way.title()}{i}" for i in range(1, len(table))]
    assert [float(variables[name].start) for name in names] == list(table[1:])
    for name, speed in zip(names, MAP.speed[1:], strict=True):
        stated = re.search(r"at ([\d.]+) m/s", variables[name].description)
        assert stated is not None
        assert float(stated[1]) == speed
    assert f"Damp.{end.title()}{way.title()}{len(table)}" not in variables


def test_the_scales_are_the_fmus_default() -> None:
    assert [parameter(f"Damp.Scale{corner}") for corner in CORNERS] == list(MAP.scale)


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
def test_at_the_points_of_the_map_the_fmu_has_its_force(
    measured: dict[float, tuple[Array, Array]], command: float
) -> None:
    velocity, wheel_force = measured[command]
    checked = 0
    for corner in range(4):
        for point in (*(-s for s in MAP.speed[1:]), *MAP.speed[1:]):
            (near,) = np.nonzero(np.abs(velocity[:, corner] / point - 1) < 0.02)
            for k in near:
                expected = force(float(velocity[k, corner]), command, corner)
                assert wheel_force[k, corner] == pytest.approx(expected, rel=0.015)
            checked += len(near) > 0
    assert checked > 24  # of 40: the fastest are not met at every corner


@pytest.mark.parametrize("command", [0.0, 0.5, 1.0])
def test_between_the_points_straight_lines_are_near_enough(
    measured: dict[float, tuple[Array, Array]], command: float
) -> None:
    """The FMU rounds the corners of the same table."""
    velocity, wheel_force = measured[command]
    for corner in range(4):
        inside = np.abs(velocity[:, corner]) < 1.0
        expected = np.array([force(v, command, corner) for v in velocity[inside, corner]])
        error = np.abs(wheel_force[inside, corner] - expected)
        assert (error < 0.06 * np.abs(expected) + 40.0 * MAP.scale[corner]).all()
