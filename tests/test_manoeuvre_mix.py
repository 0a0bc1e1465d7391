"""The mix: how fast and how hard it may drive, and that a seed is all that it depends on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_rig import Blind
from scipy.interpolate import BPoly, PPoly

from cosim.assembly import Assembly, assemble
from cosim.errors import InputError
from cosim.manoeuvre.line import beside, beside_bends
from cosim.manoeuvre.mix import LATERAL, LONGITUDINAL, SLOWEST, Mix
from cosim.road import load_track
from cosim.road.circle import arc_section, load_circle
from cosim.road.winding import load_winding
from cosim.scenario.load import load

TOP = 120 / 3.6
SEEDS = st.integers(0, 2**31)


# ---------------------------------------------------------------- the line beside a road with bends


def test_no_offset_is_the_road_itself() -> None:
    track = load_winding(900.0, 3)
    line, places = beside_bends(track, np.zeros_like)
    np.testing.assert_allclose(places, track.s[: len(places)], atol=1e-9)
    assert len(track.s) - len(places) <= 1
    for mine, theirs in ((line.x, track.x), (line.y, track.y), (line.heading, track.heading)):
        np.testing.assert_allclose(mine, theirs[: len(mine)], atol=1e-9)
    np.testing.assert_allclose(line.curvature, track.curvature[: len(line.s)], atol=1e-4)
    assert line.length == pytest.approx(track.length)


@pytest.mark.parametrize("t", [-2.0, 1.5])
def test_beside_an_arc_lies_an_arc_of_another_radius(t: float) -> None:
    """To the left of a left-hand bend the radius is smaller by the offset, and the way shorter."""
    track = load_circle(40.0, 180.0)
    start, end = arc_section(track)
    line, places = beside_bends(track, lambda s: t * np.clip(s / start, 0.0, 1.0) ** 3)
    on = (places > start + 1.0) & (places < end - 1.0)
    np.testing.assert_allclose(line.curvature[on], 1.0 / (40.0 - t), rtol=1e-4)
    way = np.ptp(line.s[on])
    assert way / np.ptp(places[on]) == pytest.approx((40.0 - t) / 40.0, rel=1e-4)
    distance = np.hypot(np.diff(line.x[on]), np.diff(line.y[on]))
    np.testing.assert_allclose(distance, np.diff(line.s[on]), rtol=1e-4)


def test_on_a_straight_it_is_the_line_of_the_lane_change() -> None:
    track = load_track("straight", 200.0)
    knots = [[0.0, 0.0, 0.0], [1.2, 0.0, 0.0]]
    path = PPoly.from_bernstein_basis(BPoly.from_derivatives([50.0, 90.0], knots))
    expected = beside(track, path, 200.0)
    line, _ = beside_bends(track, lambda s: np.asarray(path(np.clip(s, 50.0, 90.0))))
    n = min(len(line.s), len(expected.s))
    for name, tolerance in (("x", 1e-3), ("y", 1e-3), ("heading", 1e-3), ("curvature", 1e-3)):
        mine, theirs = getattr(line, name)[:n], getattr(expected, name)[:n]
        np.testing.assert_allclose(mine, theirs, atol=tolerance)


# ---------------------------------------------------------------- the plan


@settings(max_examples=8, deadline=None)
@given(SEEDS, st.sampled_from([1.0, 0.7, 0.4]), st.floats(40 / 3.6, TOP))
def test_the_planned_accelerations_stay_within_the_limits(
    seed: int, friction: float, top: float
) -> None:
    """V dv/ds along and v^2 k across, on winding roads, never beyond 7 m/s2 of the grip."""
    plan = Mix(seed, top, friction).plan(load_winding(700.0, seed))
    v, line = plan.speed, plan.line
    assert v.max() <= top + 1e-9
    across = v * v * np.abs(line.curvature)
    assert across.max() <= friction * LATERAL * 1.001
    assert v.min() > 1.0
    along = np.diff(v * v) / (2 * np.diff(line.s))
    assert np.abs(along).max() <= friction * LONGITUDINAL * 1.001


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_sections_cover_the_road_and_sway_less_than_the_grid_is_dense(seed: int) -> None:
    sections = Mix(seed, TOP).sections(3000.0)
    ends = [section.start + section.length for section in sections]
    np.testing.assert_allclose([0.0, *ends[:-1]], [section.start for section in sections])
    assert ends[-1] >= 3000.0
    for section in sections:
        assert SLOWEST <= section.speed <= TOP
        assert 0.0 <= section.sway <= 0.35
        s = np.linspace(section.start, section.start + section.length, 400)
        offset = section.offset(s)
        assert np.abs(offset).max() <= section.sway
        assert offset[[0, -1]].tolist() == [0.0, 0.0]
        lateral = section.sway * (2 * np.pi / section.wave) ** 2 * section.speed**2
        assert lateral <= 0.35 * (2 * np.pi / 1.5) ** 2 + 1e-9


def test_a_thousand_sections_are_of_every_kind() -> None:
    sections = Mix(1, TOP).sections(200_000.0)
    assert len(sections) > 500
    speeds = np.array([section.speed for section in sections])
    assert np.quantile(speeds, [0.05, 0.5, 0.95]) == pytest.approx([4.3, 18.1, 31.8], abs=1.5)
    for name, low, high in (("brake", 0.7, 6.0), ("accelerate", 0.7, 3.8), ("corner", 2.0, 6.5)):
        values = np.array([getattr(section, name) for section in sections])
        assert values.min() < low
        assert values.max() > high
    assert 0.15 < np.mean([section.sway > 0 for section in sections]) < 0.45


def test_the_seed_is_the_mix() -> None:
    track = load_winding(1200.0, 4)
    plans = [Mix(seed, TOP).plan(track) for seed in (6, 6, 7)]
    np.testing.assert_array_equal(plans[0].speed, plans[1].speed)
    np.testing.assert_array_equal(plans[0].line.x, plans[1].line.x)
    assert not np.array_equal(plans[0].speed[:1000], plans[2].speed[:1000])


# ---------------------------------------------------------------- driven


def built(folder: Path, road: str, rest: str = "", seed: int = 3, duration: str = "20") -> Assembly:
    path = folder / "mix.yaml"
    path.write_text(
        f"name: a mix\nseed: {seed}\nduration: {duration}\nroad: {{{road}}}\n"
        f"manoeuvre: {{kind: mix}}\n{rest}"
    )
    scenario = load(path)
    return assemble(scenario, scenario.controllers[0], sensor=Blind())


@pytest.mark.parametrize(("surface", "friction"), [("smooth", 1), ("D", 1), ("B", 0.4)])
def test_it_is_driven_on_every_surface(tmp_path: Path, surface: str, friction: float) -> None:
    road = f"track: winding, length_m: 600, surface: {surface}, friction: {friction}"
    assembly = built(tmp_path, road)
    result = assembly.run(None)
    assert result.finish_reason == "duration reached"
    assert result.largest_deviation_m < 0.6
    channels = assembly.recorder.group("channels")
    smoothed = np.convolve(channels[:, 1], np.ones(20) / 20, "valid")
    assert np.abs(smoothed).max() < friction * LATERAL * 1.15
    assert channels[:, 6].min() > 1.0
    assert channels[:, 6].max() < TOP * 1.05
    assert set(result.manoeuvre) == {
        "speed_mean_kmh", "path_deviation_m", "lateral_acceleration_max_m_s2", "yaw_rate_max_deg_s",
    }  # fmt: skip


def test_the_same_seed_gives_the_same_bits(tmp_path: Path) -> None:
    records = []
    for seed in (3, 3, 4):
        assembly = built(tmp_path, "track: winding, length_m: 600", "", seed, "3")
        assembly.run(None)
        records.append(assembly.recorder.frame().to_numpy().tobytes())
    assert records[0] == records[1]
    assert records[0] != records[2]


def test_a_mix_straight_ahead_ends_with_the_road(tmp_path: Path) -> None:
    road = "track: straight, length_m: 300"
    assembly = built(tmp_path, road, "driver: {speed_kmh: 70}\n", duration="lap")
    result = assembly.run(None)
    assert result.finish_reason == "end of the manoeuvre"
    assert assembly.recorder.group("channels")[:, 6].max() < 71.5 / 3.6


@pytest.mark.parametrize(
    ("road", "words"),
    [
        (
            "track: hockenheim",
            "the mix needs the winding or the straight track, not",
        ),
        ("track: straight", "the straight track needs its length_m"),
    ],
)
def test_where_a_mix_cannot_be_driven(tmp_path: Path, road: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        built(tmp_path, road)
