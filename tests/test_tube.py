"""The tube around a golden, and the samples that are kept of one."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.regression.thinning import kept_rows
from cosim.regression.tube import distance

Array = npt.NDArray[np.float64]

numbers = st.floats(-100, 100).map(lambda x: round(x, 3))
signals = st.lists(numbers, min_size=2, max_size=30)
tolerances = st.sampled_from([0.0, 0.25, 0.5, 1.0, 1.7, 3.0, 50.0])


def apart(one: list[float], other: list[float], tolerance: float) -> list[float]:
    """The distance at each sample, by a way of its own: where the polyline goes from k - tolerance
    to k + tolerance it takes every value between its least and its greatest corner or end.
    """

    def outside(values: list[float], polyline: list[float], k: int) -> float:
        begin, end = max(k - tolerance, 0.0), min(k + tolerance, len(polyline) - 1.0)
        corners = [i for i in range(len(polyline)) if begin <= i <= end]
        taken = [polyline[i] for i in corners]
        taken += [float(np.interp(t, range(len(polyline)), polyline)) for t in (begin, end)]
        return max(min(taken) - values[k], values[k] - max(taken), 0.0)

    return [max(outside(one, other, k), outside(other, one, k)) for k in range(len(one))]


@given(st.data(), tolerances)
def test_the_distance_is_that_from_the_polyline_within_the_tolerance(
    data: st.DataObject, tolerance: float
) -> None:
    one = data.draw(signals)
    other = data.draw(st.lists(numbers, min_size=len(one), max_size=len(one)))
    found = distance(np.array(one), np.array(other), tolerance)
    assert found == pytest.approx(apart(one, other, tolerance), abs=1e-9)


@given(signals, st.integers(0, 5))
def test_a_signal_that_comes_a_little_late_is_in_its_tube(values: list[float], late: int) -> None:
    shifted = [values[0]] * late + values
    held = values + [values[-1]] * late
    found = distance(np.array(held), np.array(shifted), late)
    assert found.max() == 0.0


def test_a_peak_that_is_missing_and_one_that_is_new() -> None:
    """Within a tolerance in time that is longer than the peak; either way round."""
    flat, peak = np.zeros(100), np.zeros(100)
    peak[50] = 1.0
    for one, other in ((flat, peak), (peak, flat)):
        assert distance(one, other, 5.0)[50] == 1.0
        assert distance(one, other, 5.0).sum() == 1.0


def test_gaps() -> None:
    nan = math.nan
    one = np.array([nan, nan, 2.0, 2.0, nan])
    assert distance(one, one, 0.0).max() == 0.0
    late = np.array([nan, nan, nan, 2.0, nan])
    assert np.isinf(distance(one, late, 0.0)).tolist() == [False, False, True, False, False]
    assert distance(one, late, 1.0).max() == 0.0  # a number a sample later, and a gap at the same
    assert np.isinf(distance(one, np.zeros(5), 0.0)).tolist() == [True, True, False, False, True]


# ---------------------------------------------------------------- thinning


@given(st.lists(numbers, min_size=1, max_size=200), st.sampled_from([1e-6, 0.1, 5.0, 1000.0]))
def test_straight_lines_between_the_kept_samples_pass_all_others(
    values: list[float], tolerance: float
) -> None:
    x = np.array(values)
    rows = kept_rows(x, tolerance)
    assert rows[0] == 0
    assert rows[-1] == len(x) - 1
    assert (np.diff(rows) > 0).all()
    lines = np.interp(np.arange(len(x)), rows, x[rows])
    assert np.abs(lines - x).max() <= tolerance * (1 + 1e-9)


@given(st.lists(st.none() | numbers, min_size=1, max_size=60), st.sampled_from([0.1, 50.0]))
def test_gaps_stay_where_they_are(values: list[float | None], tolerance: float) -> None:
    x = np.array([math.nan if v is None else v for v in values])
    rows = kept_rows(x, tolerance)
    lines = np.interp(np.arange(len(x)), rows, x[rows])
    np.testing.assert_array_equal(np.isnan(lines), np.isnan(x))
    there = ~np.isnan(x)
    assert (np.abs(lines - x)[there] <= tolerance * (1 + 1e-9)).all()


def test_a_straight_line_needs_two_samples_and_a_sine_few() -> None:
    assert kept_rows(np.linspace(0, 3, 500), 1e-9).tolist() == [0, 499]
    t = np.linspace(0, 1, 1000)
    # Chords of a circle of curvature (2 pi)^2 that part from it by 0.01: pi / 0.2 of them if their
    # ends lie on the circle, as these do.
    assert 10 <= len(kept_rows(np.sin(2 * math.pi * t), 0.01)) <= 35
