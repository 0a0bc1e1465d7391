"""Faults of the values: their size, their statistics, their course in time."""

from __future__ import annotations

import numpy as np
import pytest
from fault_rig import AZ, VFL, H, clock, errors, through, varied
from scipy import stats

from sensor.channels import CHANNEL_NAMES

SAMPLES = 20_000
UNLIKELY = 1e-4  # of a test of significance


def test_a_bias_is_added_from_start_to_end_and_nowhere_else() -> None:
    found = errors(10, {"kind": "bias", "channels": "Car.az", "value": 0.5, "start_s": 0.03,
                        "end_s": 0.06})  # fmt: skip
    np.testing.assert_array_equal(found, [0, 0, 0, 0.5, 0.5, 0.5, 0, 0, 0, 0])


@pytest.mark.parametrize("start", [0.07, 0.29, 0.57, 1.13])
def test_a_time_that_binary_digits_miss_is_the_sample_that_is_meant(start: float) -> None:
    found = errors(200, {"kind": "bias", "channels": "Car.az", "value": 1, "start_s": start})
    assert int(np.argmax(found)) == round(start * 100)
    between = errors(200, {"kind": "bias", "channels": "Car.az", "value": 1,
                           "start_s": start + 0.004})  # fmt: skip
    assert int(np.argmax(between)) == round(start * 100) + 1


def test_a_ramp_grows_from_the_start_and_fades_before_the_end() -> None:
    found = errors(100, {"kind": "bias", "channels": "Car.az", "value": 2.0, "start_s": 0.1,
                         "end_s": 0.6, "ramp_s": 0.2})  # fmt: skip
    t = np.arange(100) * H
    expected = 2.0 * np.interp(t, [0.1, 0.3, 0.4, 0.6], [0.0, 1.0, 1.0, 0.0])
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_drift_has_its_slope_in_time() -> None:
    found = errors(3001, {"kind": "drift", "channels": "Car.az", "rate": "0.6 m/s2/min",
                          "start_s": 10.0})  # fmt: skip
    assert not found[:1001].any()
    slope, at_start = np.polyfit(np.arange(2001) * H, found[1000:], 1)
    assert slope == pytest.approx(0.01, rel=1e-9)
    assert at_start == pytest.approx(0.0, abs=1e-9)


def test_a_gain_multiplies() -> None:
    channels = varied(50)
    found = through(channels, {"kind": "gain", "channels": "all", "factor": -1.25})
    np.testing.assert_allclose(found, -1.25 * channels, rtol=1e-15)


def test_noise_is_white_and_normal_with_its_rms() -> None:
    found = errors(SAMPLES, {"kind": "noise", "channels": "Car.az", "rms": 0.3})
    spread = 0.3 / np.sqrt(2 * SAMPLES)  # standard deviation of a standard deviation
    assert found.std() == pytest.approx(0.3, abs=4 * spread)
    assert stats.kstest(found / 0.3, "norm").pvalue > UNLIKELY
    power = np.abs(np.fft.rfft(found)) ** 2
    scaled = power[1:-1] / power[1:-1].mean()  # of white noise: exponential, at every frequency
    assert stats.kstest(scaled, "expon").pvalue > UNLIKELY
    quarters = scaled[: len(scaled) // 4 * 4].reshape(4, -1).mean(axis=1)
    np.testing.assert_allclose(quarters, 1.0, atol=4 * 2 / np.sqrt(SAMPLES / 2))


def test_a_ramp_lets_noise_and_spikes_grow() -> None:
    ramp = {"channels": "Car.az", "ramp_s": SAMPLES * H}
    share = np.arange(SAMPLES) / SAMPLES
    noise = errors(SAMPLES, {"kind": "noise", "rms": 0.3, **ramp})
    scaled = noise[1:] / (0.3 * share[1:])
    assert stats.kstest(scaled, "norm").pvalue > UNLIKELY
    spikes = errors(SAMPLES, {"kind": "spikes", "height": 7.0, "rate_hz": 5.0, **ramp})
    hit = spikes != 0
    np.testing.assert_allclose(np.abs(spikes[hit]), 7.0 * share[hit], rtol=1e-12)


def test_channels_have_noise_of_their_own_that_does_not_depend_on_the_others() -> None:
    both = through(
        np.zeros((SAMPLES, 14)), {"kind": "noise", "channels": "accelerations", "rms": 1.0}
    )
    assert abs(np.corrcoef(both[:, AZ], both[:, 0])[0, 1]) < 4 / np.sqrt(SAMPLES)
    np.testing.assert_array_equal(
        errors(SAMPLES, {"kind": "noise", "channels": "Car.az", "rms": 1.0}), both[:, AZ]
    )


def test_quantisation_leaves_multiples_of_its_step_and_a_uniform_error() -> None:
    step = 0.04
    channels = np.random.default_rng(3).normal(size=(SAMPLES, 14))
    found = through(channels, {"kind": "quantisation", "channels": "Car.az", "step": step})[:, AZ]
    np.testing.assert_allclose(found / step, np.rint(found / step), atol=1e-9)
    error = found - channels[:, AZ]
    assert np.abs(error).max() <= step / 2 * (1 + 1e-12)
    assert error.std() == pytest.approx(step / np.sqrt(12), rel=4 / np.sqrt(SAMPLES))
    assert stats.kstest(error, "uniform", args=(-step / 2, step)).pvalue > UNLIKELY


def test_a_ramp_lets_the_step_of_a_quantisation_grow() -> None:
    found = through(varied(200), {"kind": "quantisation", "channels": "Car.az", "step": 1.0,
                                  "ramp_s": 2.0})[:, AZ]  # fmt: skip
    sizes = np.arange(1, 200) / 200
    np.testing.assert_allclose(found[1:] / sizes, np.rint(found[1:] / sizes), atol=1e-9)


def test_a_saturation_cuts_off_what_is_outside() -> None:
    channels = varied(500)
    found = through(channels, {"kind": "saturation", "channels": "Car.az", "min": -3, "max": 5.5})
    np.testing.assert_array_equal(found[:, AZ], np.clip(channels[:, AZ], -3.0, 5.5))
    above = through(channels, {"kind": "saturation", "channels": "Car.az", "max": 5.5})
    np.testing.assert_array_equal(above[:, AZ], np.minimum(channels[:, AZ], 5.5))


def test_a_stuck_channel_keeps_its_value_at_the_start() -> None:
    found = through(clock(50), {"kind": "stuck", "channels": "Car.az", "start_s": 0.1,
                                "end_s": 0.3})[:, AZ]  # fmt: skip
    expected = np.arange(50.0)
    expected[10:30] = 10.0
    np.testing.assert_array_equal(found, expected)


def test_a_stuck_channel_may_show_a_value_of_its_own() -> None:
    found = through(clock(50), {"kind": "stuck", "channels": "Car.az", "value": "0.5 g"})
    np.testing.assert_array_equal(found[:, AZ], 0.5 * 9.80665)


def test_spikes_come_as_often_as_they_should_and_half_of_them_downward() -> None:
    found = errors(SAMPLES, {"kind": "spikes", "channels": "Car.az", "height": 7.0, "rate_hz": 5.0})
    assert set(np.unique(found)) == {-7.0, 0.0, 7.0}
    hit = int(np.count_nonzero(found))
    assert stats.binomtest(hit, SAMPLES, 0.05).pvalue > UNLIKELY
    assert stats.binomtest(int(np.count_nonzero(found > 0)), hit, 0.5).pvalue > UNLIKELY
    gaps = np.diff(np.flatnonzero(found))  # of independent samples: geometric
    assert gaps.mean() == pytest.approx(20.0, rel=4 / np.sqrt(hit))


def test_spikes_hit_each_channel_by_itself() -> None:
    found = through(
        np.zeros((SAMPLES, 14)),
        {"kind": "spikes", "channels": "all", "height": "1 m/s", "rate_hz": 10}
        | {"channels": "wheel_speeds"},
    )
    both = np.count_nonzero((found[:, VFL] != 0) & (found[:, VFL + 1] != 0))
    assert stats.binomtest(int(both), SAMPLES, 0.01).pvalue > UNLIKELY
    assert not found[:, CHANNEL_NAMES.index("Car.vx")].any()


@pytest.mark.parametrize(
    ("written", "channel", "meant"),
    [
        ("90 deg/s", "Car.YawRate", np.pi / 2),
        ("1 rad/s", "Car.YawRate", 1.0),
        ("36 km/h", "Car.vx", 10.0),
        ("0.1 g", "Car.az", 0.980665),
        ("-2e1 mm/s2", "Car.az", -0.02),
        ("180°", "Steer.WhlAng", np.pi),
        (0.25, "Car.az", 0.25),
    ],
)
def test_a_value_may_come_with_its_unit(written: object, channel: str, meant: float) -> None:
    found = errors(
        1, {"kind": "bias", "channels": channel, "value": written},
        channel=CHANNEL_NAMES.index(channel),
    )  # fmt: skip
    assert found[0] == pytest.approx(meant, rel=1e-12)
