"""The network with carried state on bad days: garbled and missing channels, spinning wheels, an
hour of the same.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from sensor.baselines import FirFilter
from sensor.carried.features import features
from sensor.carried.runtime import LARGEST, WARM_UP, CarriedSensor
from sensor.channels import CHANNEL_NAMES, PASSIVE_COMMAND
from sensor.conditions import CONDITIONS, Condition
from sensor.errors import SensorError
from sensor.estimators import make, model_file
from sensor.features import WHEEL_SPEEDS
from sensor.metrics import rms
from sensor.missing import HeldSamples

AZ, VX = CHANNEL_NAMES.index("Car.az"), CHANNEL_NAMES.index("Car.vx")
COMMAND = np.full(4, PASSIVE_COMMAND)


def shipped() -> list[Condition]:
    found: list[Condition] = []
    for condition in CONDITIONS:
        try:
            model_file("carried", condition)
        except SensorError:
            continue
        found.append(condition)
    return found


SHIPPED = pytest.mark.parametrize("condition", shipped() or ["ideal"])
pytestmark = pytest.mark.skipif(not shipped(), reason="no network with carried state is here")


@cache
def sensor(condition: Condition) -> CarriedSensor:
    estimator = make("carried", condition)
    assert isinstance(estimator, CarriedSensor)
    return estimator


def drive(samples: int, seed: int = 1, speed: float = 14.0) -> np.ndarray:
    """Body motion and wheel-speed residuals of about class B, and no driving."""
    random = np.random.default_rng(seed)
    size = np.array([0.1, 0.1, 0.5, 0.03, 0.03, 0.005])
    channels = np.zeros((samples, 14))
    noise = random.normal(size=(samples, 10))
    smooth = lfilter([0.3], [1.0, -0.7], noise, axis=0) / 0.42
    channels[:, :6] = smooth[:, :6] * size
    channels[:, [VX, *WHEEL_SPEEDS]] = speed
    channels[:, WHEEL_SPEEDS] += 0.02 * smooth[:, 6:]
    return channels


def commands(samples: int) -> np.ndarray:
    return np.tile(COMMAND, (samples, 1))


physical = st.tuples(*(st.floats(-limit, limit) for limit in (LARGEST / 4).tolist()))
absurd = st.tuples(*14 * (st.floats(-3e38, 3e38, allow_nan=False),))


@SHIPPED
@settings(max_examples=8, deadline=None)
@given(samples=st.lists(st.one_of(physical, absurd), min_size=1, max_size=20))
def test_whatever_finite_comes_the_estimate_is_finite_and_recovers(
    condition: Condition, samples: list[tuple[float, ...]]
) -> None:
    usual = drive(WARM_UP + 1)
    one = sensor(condition)
    one.reset()
    for row in [*usual, *np.array(samples), *usual]:
        if one.step(row, COMMAND):
            assert np.abs(one.estimate).max() < 1e3  # m/s; no NaN either
            assert np.isfinite(one.deviation).all()
            assert (one.deviation > 0.0).all()


@SHIPPED
def test_a_garbled_sample_is_forgotten(condition: Condition) -> None:
    channels = drive(1500)
    garbled = channels.copy()
    garbled[300] = 3e38 * np.resize([1.0, -1.0], 14)
    one = sensor(condition)
    want, got = one.apply(channels, commands(1500)), one.apply(garbled, commands(1500))
    assert np.isfinite(got[WARM_UP:]).all()
    after = [rms((got - want)[k : k + 200]) for k in (300, 700, 1300)]
    assert all(b < a for a, b in pairwise(after))
    assert after[-1] < 0.25 * rms(want[1300:])


@SHIPPED
@pytest.mark.parametrize("channel", ["Car.az", "Car.vFL", "Car.vx"])
def test_a_frozen_channel_is_recovered_from(condition: Condition, channel: str) -> None:
    channels = drive(1600)
    frozen = channels.copy()
    row = CHANNEL_NAMES.index(channel)
    frozen[400:900, row] = channels[400, row]
    one = sensor(condition)
    want, got = one.apply(channels, commands(1600)), one.apply(frozen, commands(1600))
    assert np.array_equal(got[WARM_UP:400], want[WARM_UP:400])
    assert rms((got - want)[1400:]) < 0.3 * rms(want[1400:])


@SHIPPED
def test_a_spinning_wheel_is_bounded(condition: Condition) -> None:
    channels = drive(1200)
    spinning = channels.copy()
    spinning[600:800, WHEEL_SPEEDS[0]] += np.linspace(0.0, 30.0, 200)
    one = sensor(condition)
    want, got = one.apply(channels, commands(1200)), one.apply(spinning, commands(1200))
    # as if the wheel were 0.25 m/s too fast, where its residual is cut off; and no more
    assert np.abs(got[600:800]).max() < 3.0  # m/s
    clipped = channels.copy()
    clipped[600:800, WHEEL_SPEEDS[0]] += 0.3
    same = one.apply(clipped, commands(1200))
    assert rms((got - same)[620:800]) < 0.5 * rms((got - want)[620:800]) + 0.01


def test_nothing_drifts_in_an_hour_of_the_same() -> None:
    minute = drive(6000)
    hour = np.tile(minute, (60, 1))
    rows = features(hour, commands(len(hour)))
    second, last = rows[2 * 6000 : 3 * 6000], rows[-6000:]
    assert np.isfinite(rows).all()
    assert np.abs(last - second).max() < 0.12  # of a scale of 1: the slow means' memory is 30 s
    assert np.abs(last - rows[-12000:-6000]).max() < 1e-4


@SHIPPED
def test_a_tyre_of_another_radius_is_learned_while_driving(condition: Condition) -> None:
    channels = drive(3000)
    worn = channels.copy()
    worn[:, WHEEL_SPEEDS[0]] *= 1.004
    one = sensor(condition)
    want, got = one.apply(channels, commands(3000)), one.apply(worn, commands(3000))
    difference = [rms((got - want)[k : k + 200]) for k in (WARM_UP, 2800)]
    assert difference[1] < 0.3 * difference[0]


def linear() -> FirFilter:
    random = np.random.default_rng(3)
    return FirFilter(random.normal(scale=0.01, size=(5, 14, 4)), np.zeros(4))


def test_a_short_gap_is_bridged_by_the_last_value() -> None:
    channels = drive(60)
    gap, held = channels.copy(), channels.copy()
    gap[20:25, AZ] = np.nan
    held[20:25, AZ] = channels[19, AZ]
    got = HeldSamples(linear(), longest=0.05, settling=0.2).apply(gap, commands(60))
    want = linear().apply(held, commands(60))
    assert got[4:] == pytest.approx(want[4:], abs=1e-12)
    assert np.isnan(got[:4]).all()


def test_a_long_gap_makes_the_estimate_invalid_until_the_channel_has_settled() -> None:
    channels = drive(100)
    channels[20:40, [AZ, VX]] = np.nan
    one = HeldSamples(linear(), longest=0.05, settling=0.2)
    valid = np.array([one.step(row, COMMAND) for row in channels])
    assert not valid[:4].any()
    assert valid[4:25].all()
    assert not valid[25:59].any()
    assert valid[59:].all()  # the twentieth sample after the gap
    assert np.isfinite(one.estimate).all()
    one.step(np.where(np.arange(14) == AZ, np.inf, channels[0]), COMMAND)
    assert [CHANNEL_NAMES[i] for i in np.flatnonzero(one.missing)] == ["Car.az"]


def test_nothing_is_estimated_before_every_channel_has_come() -> None:
    channels = drive(30)
    channels[:10, VX] = np.nan
    one = HeldSamples(linear())
    valid = [one.step(row, COMMAND) for row in channels]
    assert valid.index(True) == 14
    one.reset()
    assert np.isnan(one.estimate).all()
    assert not one.step(channels[0], COMMAND)
