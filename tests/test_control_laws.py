"""The laws of semi-active control, against what is published of them or follows from mechanics."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from control_rig import Told, sample
from hypothesis import given
from hypothesis import strategies as st
from quarter_car import QuarterCar
from scipy.stats import norm

from cosim.control.add import Add, SkyhookAdd
from cosim.control.body import Body
from cosim.control.cautious import CautiousSkyhook
from cosim.control.damper_map import DamperMap
from cosim.control.hybrid import Hybrid
from cosim.control.law import Law, LawController
from cosim.control.modal import ModalGains, ModalSkyhook
from cosim.control.skyhook import Skyhook, TwoStateSkyhook

Array = npt.NDArray[np.float64]

MAP = DamperMap()
MIXING = Body().mixing
LAWS: dict[str, Callable[[], Law]] = {
    "skyhook": lambda: Skyhook(MAP, 3500.0),
    "cautious": lambda: CautiousSkyhook(MAP),
    "two states": lambda: TwoStateSkyhook(1.0),
    "add": lambda: Add(1.0),
    "sh-add": lambda: SkyhookAdd(1.0),
    "hybrid": lambda: Hybrid(MAP, 3500.0, 0.5),
    "groundhook": lambda: Hybrid(MAP, 3500.0, 0.0),
    "modal": lambda: ModalSkyhook(MAP, MIXING),
}

speeds = st.floats(-2.0, 2.0, allow_subnormal=False)
corners = st.lists(speeds, min_size=4, max_size=4).map(np.array)
modes = st.lists(speeds, min_size=3, max_size=3).map(np.array)


def commanded(law: Law, body: Body, relative: Array, deviation: float = 0.0) -> Array:
    out = np.full(4, np.nan)
    law(body, relative, np.full(4, deviation), out)
    return out


def forces(commands: Array, relative: Array) -> Array:
    """What the dampers then do at the wheels (4,) [N], positive against extension."""
    return np.array([MAP.force(i, relative[i], commands[i]) for i in range(4)])


# ---------------------------------------------------------------- of every law


@pytest.mark.parametrize("name", LAWS)
@given(corners, corners, modes, corners)
def test_every_commanded_force_is_passive(
    name: str, velocity: Array, acceleration: Array, mode: Array, relative: Array
) -> None:
    """A command between soft and hard, so a force that takes power out of the motion."""
    commands = commanded(LAWS[name](), Told(velocity, acceleration, mode), relative)
    assert ((commands >= 0.0) & (commands <= 1.0)).all()
    assert (forces(commands, relative) * relative >= 0.0).all()


@pytest.mark.parametrize("name", ["two states", "add", "sh-add"])
@given(corners, corners, corners)
def test_a_switching_law_does_the_same_upside_down(
    name: str, velocity: Array, acceleration: Array, relative: Array
) -> None:
    one = commanded(LAWS[name](), Told(velocity, acceleration), relative)
    other = commanded(LAWS[name](), Told(-velocity, -acceleration), -relative)
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", LAWS)
def test_until_an_estimate_is_valid_the_initial_command_stays(name: str) -> None:
    body = Told(np.full(4, 0.5), np.full(4, 3.0), np.array([0.5, 0.0, 0.0]))
    controller = LawController(LAWS[name](), False, 0.35, body)
    relative = np.full(4, 0.3)
    for _ in range(5):
        assert controller.step(sample(truth=relative)).tolist() == [0.35] * 4
    acted = controller.step(sample(None, relative, True)).copy()
    np.testing.assert_array_equal(acted, commanded(LAWS[name](), body, relative))
    assert (acted != 0.35).all()
    np.testing.assert_array_equal(controller.step(sample(None, -relative)), acted)


def test_on_the_truth_no_estimate_is_needed_nor_read() -> None:
    controller = LawController(TwoStateSkyhook(1.0), True, 0.35, Told(np.full(4, 0.5)))
    up, down = np.full(4, 0.3), np.full(4, -0.3)
    assert controller.step(sample(None, down, True, up)).tolist() == [1.0] * 4
    assert controller.step(sample(None, up, False, down)).tolist() == [0.0] * 4


def test_the_body_s_filters_settle_while_nothing_is_valid() -> None:
    t = 0.01 * np.arange(300)
    measured = np.zeros((300, 14))
    measured[:, 2] = 2.0 * np.sin(2 * np.pi * 1.2 * t)
    late, early = (LawController(Skyhook(MAP), False) for _ in range(2))
    for k, row in enumerate(measured):
        relative = np.full(4, 0.2)
        one = late.step(sample(row, relative, k >= 100)).copy()
        other = early.step(sample(row, relative, True))
        if k >= 100:
            np.testing.assert_array_equal(one, other)
    assert one.max() > 0


# ---------------------------------------------------------------- skyhook


@given(corners, corners)
def test_two_states_choose_what_takes_more_power_from_the_body(
    velocity: Array, relative: Array
) -> None:
    """The force on the body is -F, the power that it gives it -F v_body: the lesser one of both."""
    commands = commanded(TwoStateSkyhook(1.0), Told(velocity), relative)
    for i in range(4):
        powers = [-MAP.force(i, relative[i], u) * velocity[i] for u in (0.0, 1.0)]
        if abs(powers[1] - powers[0]) > 1e-9:
            assert commands[i] == float(powers[1] < powers[0])


@given(corners, corners)
def test_continuous_skyhook_comes_as_near_to_its_force_as_a_damper_can(
    velocity: Array, relative: Array
) -> None:
    commands = commanded(Skyhook(MAP, 3500.0), Told(velocity), relative)
    for i, u in enumerate(commands):
        ends = [MAP.force(i, relative[i], end) for end in (0.0, 1.0)]
        nearest = np.clip(3500.0 * velocity[i], min(ends), max(ends))
        reached = MAP.force(i, relative[i], u)
        assert abs(reached - nearest) < 1.01  # N: dampers nearly at rest are left soft


def test_the_hard_state_may_be_softer() -> None:
    body, relative = Told(np.full(4, 0.5), np.full(4, 1.0)), np.full(4, 0.2)
    for law in (TwoStateSkyhook(0.3), Add(0.3), SkyhookAdd(0.3)):
        assert commanded(law, body, relative).tolist() == [0.3] * 4
        assert commanded(law, body, -relative).tolist() == [0.0] * 4


# ---------------------------------------------------------------- cautious skyhook


@given(corners, corners)
def test_who_knows_exactly_needs_no_caution(velocity: Array, relative: Array) -> None:
    one = commanded(CautiousSkyhook(MAP, 3500.0, 0.0), Told(velocity), relative)
    np.testing.assert_array_equal(one, commanded(Skyhook(MAP, 3500.0), Told(velocity), relative))


@pytest.mark.parametrize("deviation", [0.02, 0.08, 0.2])
@pytest.mark.parametrize("estimate", [-0.3, -0.03, 0.0, 0.05, 0.4])
def test_no_other_command_is_nearer_on_the_average(estimate: float, deviation: float) -> None:
    """Against the mean square distance over 20001 equally likely velocities."""
    share = (np.arange(20_001) + 0.5) / 20_001
    velocities = estimate + deviation * norm.ppf(share)
    soft, hard = (np.array([MAP.force(0, v, u) for v in velocities.tolist()]) for u in (0.0, 1.0))

    def distance(u: float, wanted: float) -> float:
        return float(np.mean((soft + u * (hard - soft) - wanted) ** 2))

    for velocity in (-0.3, 0.02, 0.15):
        law = CautiousSkyhook(MAP, 3500.0, 0.0)
        found = commanded(law, Told(np.full(4, velocity)), np.full(4, estimate), deviation)[0]
        all_commands = np.linspace(0.0, 1.0, 201)
        best = min(distance(u, 3500.0 * velocity) for u in all_commands)
        assert distance(found, 3500.0 * velocity) < 1.02 * best + 1.0


def test_the_less_is_known_the_softer() -> None:
    """Of a force that may have either sign nothing is left."""
    body, relative = Told(np.full(4, 0.2)), np.full(4, 0.05)
    law = CautiousSkyhook(MAP, 3500.0, 0.0)
    found = [commanded(law, body, relative, d)[0] for d in (0.0, 0.02, 0.05, 0.1, 0.3)]
    assert found == sorted(found, reverse=True)
    assert found[0] > 0.7
    assert found[-1] < 0.1


def test_an_estimator_without_a_deviation_gets_the_least() -> None:
    body, relative = Told(np.full(4, 0.2)), np.full(4, 0.1)
    law = CautiousSkyhook(MAP, 3500.0, 0.05)
    usual = commanded(law, body, relative, 0.05)
    np.testing.assert_array_equal(commanded(law, body, relative, np.nan), usual)
    np.testing.assert_array_equal(commanded(law, body, relative, 0.001), usual)
    assert (commanded(law, body, relative, 0.1) < usual).all()


# ---------------------------------------------------------------- ADD and SH-ADD


@given(corners, corners, corners, corners)
def test_add_does_not_ask_for_the_velocity_of_the_body(
    velocity: Array, other: Array, acceleration: Array, relative: Array
) -> None:
    one = commanded(Add(1.0), Told(velocity, acceleration), relative)
    np.testing.assert_array_equal(one, commanded(Add(1.0), Told(other, acceleration), relative))


@given(corners, corners)
def test_add_leaves_the_smaller_acceleration(acceleration: Array, relative: Array) -> None:
    """Of both states, that which brings the body's acceleration nearer to zero, for a change of
    force so small that it does not turn it over: the one-step optimum of the paper.
    """
    commands = commanded(Add(1.0), Told(np.zeros(4), acceleration), relative)
    for i in range(4):
        changes = [-MAP.force(i, relative[i], u) * acceleration[i] for u in (0.0, 1.0)]
        if abs(changes[1] - changes[0]) > 1e-9:
            assert commands[i] == float(changes[1] < changes[0])


@pytest.mark.parametrize("hz", [0.5, 1.2, 1.9, 3.0, 8.0])
def test_a_harmonic_motion_shares_its_time_between_both_laws(hz: float) -> None:
    """|a| <= alpha |v| with v = cos(w t) is |tan(w t)| <= alpha / w: for 2 / pi arctan(alpha / w)
    of the time, half of it at the crossover.
    """
    t = np.random.default_rng(1).uniform(0.0, 50.0, 20_000)
    w = 2 * np.pi * hz
    velocity, acceleration = np.cos(w * t), -w * np.sin(w * t)
    differ = velocity * acceleration < 0
    law, out, sky = SkyhookAdd(1.0, 1.9), np.zeros(4), []
    for v, a in zip(velocity[differ], acceleration[differ], strict=True):
        law(Told(np.full(4, v), np.full(4, a)), np.full(4, np.sign(v)), np.zeros(4), out)
        sky.append(out[0])  # hard is what skyhook says here, soft what ADD says
    assert np.mean(sky) == pytest.approx(2 / np.pi * np.arctan(1.9 / hz), abs=0.01)


# ---------------------------------------------------------------- groundhook and hybrid


@given(corners, corners)
def test_all_sky_is_skyhook(velocity: Array, relative: Array) -> None:
    one = commanded(Hybrid(MAP, 3500.0, 1.0), Told(velocity), relative)
    np.testing.assert_allclose(one, commanded(Skyhook(MAP, 3500.0), Told(velocity), relative))


@given(corners, corners)
def test_all_ground_is_a_skyhook_for_the_wheel(velocity: Array, relative: Array) -> None:
    """The wheel hangs on the damper's other end: its velocity stands for the body's, turned."""
    wheel = velocity - relative
    one = commanded(Hybrid(MAP, 3500.0, 0.0), Told(velocity), relative)
    np.testing.assert_allclose(one, commanded(Skyhook(MAP, 3500.0), Told(-wheel), relative))


# ---------------------------------------------------------------- full-car modal skyhook


@given(modes)
def test_the_corner_forces_add_up_to_the_modes(mode: Array) -> None:
    """Sum, moment about x and moment about y: rigid-body statics, sides and axles written out."""
    gains = ModalGains(heave=9000.0, roll=4000.0, pitch=12000.0)
    forces = ModalSkyhook(MAP, MIXING, gains).shares @ mode
    x, y = np.array([1.439, 1.439, -1.236, -1.236]), np.array([0.778, -0.847, 0.778, -0.847])
    found = [forces.sum(), (y * forces).sum(), (-x * forces).sum()]
    np.testing.assert_allclose(found, [9000, 4000, 12000] * mode, atol=1e-8)


@given(modes, st.floats(-500, 500))
def test_no_other_forces_do_it_with_less(mode: Array, extra: float) -> None:
    """The warp mode moves nothing; whatever of it is added makes the squares greater."""
    forces = ModalSkyhook(MAP, MIXING).shares @ mode
    warp = np.linalg.svd(MIXING.T)[2][3]
    assert np.abs(MIXING.T @ warp).max() < 1e-12
    assert (np.sign(warp) * np.sign(warp[0])).tolist() == [1, -1, -1, 1]
    other = forces + extra * warp
    assert other @ other >= forces @ forces - 1e-6


def test_in_heave_alone_it_is_skyhook_at_every_corner() -> None:
    """Nearly: the centre of gravity is not in the middle of the wheels."""
    body = Told(np.full(4, 0.2), modes=np.array([0.2, 0.0, 0.0]))
    modal = ModalSkyhook(MAP, MIXING, ModalGains(heave=4 * 3500.0)).shares @ body.modes
    np.testing.assert_allclose(modal, 3500.0 * 0.2, rtol=0.15)


# ---------------------------------------------------------------- on a quarter car
# Masses, stiffnesses and dampings of Savaresi, Silani & Bittanti (2005): 400 and 50 kg, 20 and 250
# kN/m, 300 and 3900 N s/m, a damper with a bandwidth of 20 Hz. The
# body's resonance is at 1.1 Hz, the wheel's at 11.6 Hz.


def body_acceleration(law: Law | float, hz: float) -> float:
    return QuarterCar().driven(law, hz).body_acceleration


def test_skyhook_filters_best_at_the_body_s_resonance() -> None:
    sky, add = (body_acceleration(law, 1.1) for law in (TwoStateSkyhook(1.0), Add(1.0)))
    assert sky < 0.7 * add
    assert sky < 0.35 * body_acceleration(0.0, 1.1)


def test_add_filters_best_above_the_crossover() -> None:
    for hz in (2.5, 5.0):
        sky, add = (body_acceleration(law, hz) for law in (TwoStateSkyhook(1.0), Add(1.0)))
        assert add < 0.5 * sky
        assert add < min(body_acceleration(0.0, hz), body_acceleration(1.0, hz))


@pytest.mark.parametrize("hz", [0.8, 1.1, 2.5, 5.0])
def test_both_mixed_filter_about_as_well_as_the_better_one(hz: float) -> None:
    sky, add, mixed = (
        body_acceleration(law, hz) for law in (TwoStateSkyhook(1.0), Add(1.0), SkyhookAdd(1.0))
    )
    assert mixed < 1.12 * min(sky, add)


def test_groundhook_calms_the_wheel_and_skyhook_the_body() -> None:
    """Tyre force at the wheel's resonance, body acceleration at the body's."""
    runs = {}
    for share in (0.0, 0.5, 1.0):
        law = QuarterCar.hybrid(3900.0, share)
        runs[share] = [QuarterCar().driven(law, hz) for hz in (11.6, 1.1)]
    tyre = [runs[share][0].tyre_force for share in (0.0, 0.5, 1.0)]
    body = [runs[share][1].body_acceleration for share in (0.0, 0.5, 1.0)]
    assert tyre[0] < tyre[1] < tyre[2]
    assert body[0] > body[1] > body[2]
    assert tyre[0] < 0.6 * tyre[2]
    assert body[2] < 0.6 * body[0]
