"""Samples from frames, whatever is lost on the way: nothing twice, nothing out of step."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cosim.bus.codec import GIVEN, to_sensor
from cosim.bus.samples import LONGEST_GAP, MODULO, Sample, Samples

PATIENCE = 0.02
FRAMES = to_sensor()
COUNT = len(FRAMES.identifiers)


def frames_of(number: int) -> list[tuple[int, bytes]]:
    """Frames of a sample whose az tells its number."""
    values = np.zeros(len(GIVEN))
    values[2] = (number % 1000) * 0.00981
    values[14:] = 0.5
    return FRAMES.encode(values, SampleCounter=number % MODULO)


def told(samples: Samples, numbers: list[int], keep: set[tuple[int, int]] | None = None):
    """Samples that are due while the frames of `numbers` come, only those in `keep` if given."""
    due: list[Sample] = []
    for place, number in enumerate(numbers):
        for i, (identifier, data) in enumerate(frames_of(number)):
            if keep is None or (number, i) in keep:
                due += samples.take(identifier, data, 0.01 * place)
    return due


def test_whole_samples_are_due_at_their_last_frame():
    samples = Samples(PATIENCE)
    for number in range(3):
        frames = frames_of(number)
        for identifier, data in frames[:-1]:
            assert samples.take(identifier, data, 1.0) == []
        (due,) = samples.take(*frames[-1], 1.0)
        assert due.counter == number
        assert due.arrived == 1.0
        np.testing.assert_allclose(due.channels[2], number * 0.00981, atol=1e-12)
        np.testing.assert_allclose(due.command, 0.5)
    assert samples.frames_lost == samples.frames_late == 0


@given(
    st.integers(0, MODULO - 1),
    st.sets(st.tuples(st.integers(0, 19), st.integers(0, COUNT - 1)), min_size=1),
)
def test_the_estimator_stays_in_step_and_every_missing_frame_is_counted(first, kept):
    samples = Samples(PATIENCE)
    samples.reset(from_zero=False)
    told(samples, [first - 1])  # the sensor knows where it stands
    numbers = [first + i for i in range(20)]
    keep = {(first + i, j) for i, j in kept}
    due = told(samples, numbers, keep) + samples.expire(1e3)
    heard = [i for i in range(20) if any((i, j) in kept for j in range(COUNT))]
    last = max(heard)
    assert [s.counter for s in due] == [(first + i) % MODULO for i in range(last + 1)]
    assert [s.arrived is not None for s in due] == [i in heard for i in range(last + 1)]
    for i, sample in enumerate(due):
        missing = np.isnan(np.concatenate([sample.channels, sample.command])).sum()
        came = [FRAMES.identifiers[j] for j in range(COUNT) if (i, j) in kept]
        carried = sum(len(FRAMES.places[identifier]) for identifier in came)
        assert missing == len(GIVEN) - carried
    assert samples.frames_lost == (last + 1) * COUNT - len(kept)


def test_order_does_not_matter_within_a_sample():
    samples = Samples(PATIENCE)
    due = [s for frame in frames_of(4)[::-1] for s in samples.take(*frame, 0.0)]
    assert [s.counter for s in due] == [4]
    assert not np.isnan(due[0].channels).any()


def test_patience_ends():
    samples = Samples(PATIENCE)
    assert samples.waiting_s(0.0) is None
    samples.take(*frames_of(0)[0], 5.0)
    np.testing.assert_allclose(samples.waiting_s(5.005), 0.015)
    assert samples.expire(5.005) == []
    (due,) = samples.expire(5.03)
    assert np.isnan(due.channels).sum() == 11
    assert samples.expire(5.04) == []
    assert samples.frames_lost == COUNT - 1
    for frame in frames_of(0)[1:]:
        assert samples.take(*frame, 5.05) == []
    assert samples.frames_late == COUNT - 1


def test_a_run_begins_at_zero_so_that_its_first_samples_can_be_missed():
    samples = Samples(PATIENCE)
    samples.reset(from_zero=True)
    due = told(samples, [2])
    assert [(s.counter, s.arrived is None) for s in due] == [(0, True), (1, True), (2, False)]
    assert samples.frames_lost == 2 * COUNT


def test_a_long_gap_is_a_fresh_start():
    samples = Samples(PATIENCE)
    told(samples, [0])
    (due,) = told(samples, [LONGEST_GAP + 2])
    assert due.fresh
    assert samples.frames_lost == (LONGEST_GAP + 1) * COUNT
    (due,) = told(samples, [LONGEST_GAP + 3])
    assert not due.fresh


def test_other_frames_and_short_ones_are_left():
    samples = Samples(PATIENCE)
    assert samples.take(0x7FF, b"", 0.0) == []
    assert samples.take(FRAMES.identifiers[0], b"\0", 0.0) == []
    assert samples.waiting_s(0.0) is None
