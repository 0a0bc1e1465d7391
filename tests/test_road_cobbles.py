"""Cobblestones: stones, rows, bed (cosim.road.cobbles)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from cosim.road import Cobbles, Iso8608, RoadError
from cosim.road.surface import FINE_STEP

S = -20.0 + FINE_STEP * np.arange(40_001)  # 1 km
V = np.array([0.6, 0.64, 1.0])


def density(line: np.ndarray, length: int = 4096) -> tuple[np.ndarray, np.ndarray]:
    return signal.welch(line, 1.0 / FINE_STEP, nperseg=length, detrend="linear")


def test_long_waves_of_the_stones_are_those_of_independent_heights() -> None:
    """A row of boxes of length L and independent heights: 2 var L sinc^2(n L), one-sided."""
    stones = Cobbles(3, crown=0.0)
    frequency, found = density(stones.stones(S, V).T)
    expected = 2.0 * stones.height**2 * stones.along * np.sinc(frequency * stones.along) ** 2
    used = (frequency > 0.1) & (frequency < 2.0)
    assert (found[:, used] / expected[used]).mean() == pytest.approx(1.0, abs=0.15)


def test_the_rows_are_a_line_in_the_spectrum() -> None:
    for along in (0.12, 0.16, 0.2):
        frequency, found = density(Cobbles(3, along, height=0.0).stones(S, V).mean(axis=1))
        assert frequency[np.argmax(found)] == pytest.approx(1.0 / along, rel=0.03)


def test_stones_differ_across_the_road() -> None:
    """0.04 m apart mostly the same stone, 0.36 m apart two others."""
    field = Cobbles(3, crown=0.0).stones(S, V)
    near, far = (np.corrcoef(field[:, 0], field[:, j])[0, 1] for j in (1, 2))
    assert near == pytest.approx(1.0 - 0.04 / 0.18, abs=0.08)
    assert far == pytest.approx(0.0, abs=0.08)


def test_the_stones_have_the_height_that_was_asked_for() -> None:
    for height in (0.002, 0.006):
        field = Cobbles(4, height=height, crown=0.0).stones(S, V)
        tilted = height * np.sqrt(1.0 + 2.0 * 0.25 / 3.0)  # both tilts, uniform over a stone
        assert field.std() == pytest.approx(tilted, rel=0.05)
        assert field.mean() == pytest.approx(0.0, abs=0.1 * height)


def test_the_bed_is_the_class() -> None:
    s, cobbles, bed = S[:6001], Cobbles(5, road_class="B"), Iso8608("B", 5)
    v = cobbles.columns(s)
    field = cobbles.elevation(s, v).astype(float)
    coarse = bed.elevation(s[::2], bed.columns(s[::2]))
    j, k = int(np.argmin(np.abs(v - 0.7))), int(np.argmin(np.abs(bed.columns(s[::2]) - 0.7)))
    behind = s[::2] > 13.0
    left = (field[::2, j] - coarse[:, k])[behind]
    stones = cobbles.stones(s, v[[j]])[::2, 0][behind]
    assert left == pytest.approx(stones, abs=2e-6)


def test_the_same_seed_gives_the_same_bytes_and_another_one_another_road() -> None:
    s = S[:4001]
    v = Cobbles(7).columns(s)
    first = Cobbles(7).elevation(s, v)
    assert first.tobytes() == Cobbles(7).elevation(s, v).tobytes()
    assert not np.array_equal(first, Cobbles(8).elevation(s, v))
    assert not first[s <= 3.0].any()


def test_columns_are_dense_where_wheels_run() -> None:
    for s in (S[:4001], S):
        v = Cobbles(1).columns(s)
        for wheel in (0.778, -0.847):
            near = (v[1:] > wheel - 0.35) & (v[:-1] < wheel + 0.35)
            assert np.diff(v)[near].max() <= 0.04 + 1e-9


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"along": 0.05}, r"stones' length is 0\.05 m; the road's grid carries 0\.1 m to 0\.5 m"),
        ({"across": 0.6}, r"stones' width is 0\.6 m"),
        ({"height": -0.001}, r"stones' height is -0\.001 m"),
        ({"road_class": "F"}, "road class 'F'"),
        ({"seed": -1}, "seed is -1"),
    ],
)
def test_stones_that_cannot_be_laid_are_refused(values: dict[str, float], sentence: str) -> None:
    with pytest.raises(RoadError, match=sentence):
        Cobbles(**{"seed": 1, **values})  # type: ignore[arg-type]
