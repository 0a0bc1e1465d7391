"""Faults of the messages: how old a reading is, how much is missing and for how long."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from fault_rig import AZ, VFL, WHEELS, Array, H, clock, through, varied
from scipy import stats

SAMPLES = 20_000
UNLIKELY = 1e-4


def ages(*faults: dict[str, Any], samples: int = SAMPLES) -> Array:
    """Return how old what is read is, in ms, for samples that have a past."""
    found = through(clock(samples), *faults)[:, AZ]
    return (np.arange(float(samples)) - found)[200:] * H * 1000.0


@pytest.mark.parametrize("delay", [10.0, 30.0, 5.0, 12.5, 0.1])
def test_a_delay_is_the_age_of_what_is_read(delay: float) -> None:
    found = ages({"kind": "delay", "channels": "Car.az", "delay_ms": delay}, samples=300)
    np.testing.assert_allclose(found, delay, rtol=1e-9)


def test_a_delay_of_whole_samples_changes_no_bit() -> None:
    channels = varied(100)
    found = through(channels, {"kind": "delay", "channels": "all", "delay_ms": 30})
    np.testing.assert_array_equal(found[3:], channels[:-3])
    np.testing.assert_array_equal(found[:3], np.repeat(channels[:1], 3, axis=0))


@pytest.mark.parametrize("frequency", [1.0, 10.0, 20.0])
def test_between_samples_a_delay_has_the_response_of_a_straight_line(frequency: float) -> None:
    """H = (1 - f) + f z^-1 with f the share of a sample; unknown to the code as a formula."""
    k = np.arange(4000.0)
    turn = 2 * np.pi * frequency * H
    channels = np.zeros((4000, 14))
    channels[:, AZ] = np.cos(turn * k)
    found = through(channels, {"kind": "delay", "channels": "Car.az", "delay_ms": 13.0})[:, AZ]
    expected = np.exp(-1j * turn) * (0.7 + 0.3 * np.exp(-1j * turn))
    np.testing.assert_allclose(found[5:], np.real(expected * np.exp(1j * turn * k))[5:], atol=1e-9)


def test_a_ramp_lets_the_delay_grow() -> None:
    found = ages(
        {"kind": "delay", "channels": "Car.az", "delay_ms": 20, "start_s": 3, "end_s": 9,
         "ramp_s": 2}, samples=1000,
    )  # fmt: skip
    t = np.arange(200, 1000) * H
    np.testing.assert_allclose(found, 20 * np.interp(t, [3, 5, 7, 9], [0, 1, 1, 0]), atol=1e-9)


def test_jitter_within_a_sample_is_uniform_and_new_at_every_sample() -> None:
    found = ages({"kind": "jitter", "channels": "Car.az", "max_ms": 8.0})
    assert stats.kstest(found, "uniform", args=(0.0, 8.0)).pvalue > UNLIKELY
    assert abs(np.corrcoef(found[1:], found[:-1])[0, 1]) < 4 / np.sqrt(len(found))


def test_long_jitter_never_reads_what_is_older_than_the_last_reading() -> None:
    """The age is the least of (draw of n samples ago + n samples): a product of survivals."""
    longest = 35.0
    found = ages({"kind": "jitter", "channels": "Car.az", "max_ms": longest}, samples=40_000)
    assert np.diff(np.arange(len(found)) * 10.0 - found).min() >= -1e-9

    def below(age: npt.ArrayLike) -> Array:
        survival = np.ones_like(np.asarray(age, dtype=float))
        for n in range(4):
            survival *= 1.0 - np.clip((np.asarray(age) - 10.0 * n) / longest, 0.0, 1.0)
        return 1.0 - survival

    apart = found[::7]  # readings that far apart share no draw
    assert stats.kstest(apart, below).pvalue > UNLIKELY


def test_delay_and_jitter_add_up() -> None:
    both = ages(
        {"kind": "delay", "channels": "Car.az", "delay_ms": 20},
        {"kind": "jitter", "channels": "Car.az", "max_ms": 5},
    )
    assert stats.kstest(both - 20.0, "uniform", args=(0.0, 5.0)).pvalue > UNLIKELY


def test_channels_of_one_fault_share_a_message_and_of_two_do_not() -> None:
    shared = through(clock(500), {"kind": "jitter", "channels": "imu", "max_ms": 9})
    np.testing.assert_array_equal(shared[:, 0], shared[:, 5])
    apart = through(
        clock(500),
        {"kind": "jitter", "channels": "Car.ax", "max_ms": 9},
        {"kind": "jitter", "channels": "Car.ay", "max_ms": 9},
    )
    assert (apart[:, 0] != apart[:, 1]).mean() > 0.99


def missing(**fields: Any) -> npt.NDArray[np.bool_]:
    fault = {"kind": "dropout", "channels": "Car.az", "fill": "nan", **fields}
    return np.isnan(through(varied(SAMPLES), fault)[:, AZ])


def test_single_samples_are_missing_in_their_share() -> None:
    lost = missing(share=0.2)
    assert stats.binomtest(int(lost.sum()), SAMPLES, 0.2).pvalue > UNLIKELY
    pairs = int((lost[1:] & lost[:-1])[::2].sum())
    assert stats.binomtest(pairs, SAMPLES // 2, 0.04).pvalue > UNLIKELY


def test_outages_have_their_mean_length_and_share() -> None:
    lost = missing(share=0.25, outage_s=0.08)
    edges = np.diff(np.concatenate(([0], lost.astype(int), [0])))
    lengths = np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)
    # geometric: the standard deviation is nearly the mean
    assert lengths.mean() == pytest.approx(8.0, rel=4 / np.sqrt(len(lengths)))
    counts = [np.count_nonzero(lengths == n) for n in range(1, 9)]
    counts.append(len(lengths) - sum(counts))
    share = stats.geom.pmf(np.arange(1, 9), 1 / 8)
    expected = len(lengths) * np.append(share, 1 - share.sum())
    assert stats.chisquare(counts, expected).pvalue > UNLIKELY
    # the share of time lost of an alternating process, by the delta method
    gaps = 8.0 * 3.0
    spread = 0.25 * 0.75 * np.sqrt(2 * (8.0 + gaps) / SAMPLES)
    assert lost.mean() == pytest.approx(0.25, abs=4 * spread)


def test_a_ramp_lets_the_share_of_missing_samples_grow() -> None:
    lost = missing(share=0.6, ramp_s=SAMPLES * H)
    for quarter in range(4):
        found = int(lost[quarter * SAMPLES // 4 : (quarter + 1) * SAMPLES // 4].sum())
        share = 0.6 * (quarter + 0.5) / 4
        assert stats.binomtest(found, SAMPLES // 4, share).pvalue > UNLIKELY


def test_outages_begin_in_their_steady_state() -> None:
    fault = {"kind": "dropout", "channels": "Car.az", "fill": "nan", "share": 0.3, "outage_s": 0.5}
    lost = [bool(np.isnan(through(varied(1), fault, seed=seed)[0, AZ])) for seed in range(600)]
    assert stats.binomtest(sum(lost), 600, 0.3).pvalue > UNLIKELY


def test_a_sample_that_is_missing_is_nan_or_the_last_that_came() -> None:
    channels = varied(300)
    fields = {"kind": "dropout", "channels": "imu", "share": 0.5, "start_s": 1.0, "end_s": 2.0}
    gaps = through(channels, {**fields, "fill": "nan"})
    held = through(channels, {**fields, "fill": "hold"})
    lost = np.isnan(gaps[:, AZ])
    assert not lost[:100].any()
    assert not lost[200:].any()
    assert 30 < lost.sum() < 70
    np.testing.assert_array_equal(np.isnan(gaps).sum(axis=1), 6 * lost)
    last = np.maximum.accumulate(np.where(lost, 0, np.arange(300)))
    np.testing.assert_array_equal(held[:, :6], channels[last, :6])
    np.testing.assert_array_equal(held[:, 6:], channels[:, 6:])


def test_before_the_first_sample_there_is_none_to_hold() -> None:
    channels = varied(5)
    held = through(channels, {"kind": "dropout", "channels": "all", "fill": "hold"})
    np.testing.assert_array_equal(held, np.repeat(channels[:1], 5, axis=0))


def test_swapped_wheels_carry_each_other_s_speed() -> None:
    channels = varied(20)
    found = through(channels, {"kind": "swapped_wheels", "wheels": ["FL", "RR"], "start_s": 0.1})
    np.testing.assert_array_equal(found[:10], channels[:10])
    np.testing.assert_array_equal(found[10:, WHEELS], channels[10:, [12, 10, 11, 9]])
    np.testing.assert_array_equal(found[:, :VFL], channels[:, :VFL])
