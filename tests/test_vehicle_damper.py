"""The damper curves against scipy's PCHIP and their own tables."""

from __future__ import annotations

import numpy as np
import pytest
from gates import at_most, gate
from plant_probe import Array, Probe
from scipy.interpolate import PchipInterpolator

SPEEDS = np.array([0.05, 0.1, 0.25, 0.5, 1.0, 2.0])
TABLES = {  # N at SPEEDS, front wheel: rebound, compression
    "passive": ([330, 560, 950, 1500, 2500, 4500], [190, 330, 600, 900, 1450, 2300]),
    "soft": ([110, 190, 330, 560, 1000], [65, 120, 230, 380, 650]),
    "hard": ([900, 1500, 2350, 3300, 4900], [520, 900, 1550, 2150, 3000]),
}
NAMES = tuple(TABLES)


@pytest.fixture(scope="module")
def plant() -> Probe:
    return Probe()


def points(name: str) -> tuple[Array, Array]:
    """Velocities (rebound positive) and forces of a table, through the origin."""
    rebound, compression = (np.array(side, float) for side in TABLES[name])
    speeds = SPEEDS[: len(rebound)]
    x = np.concatenate([-speeds[::-1], [0.0], speeds])
    return x, np.concatenate([-compression[::-1], [0.0], rebound])


def curve(plant: Probe, name: str, at: Array) -> Array:
    return np.array([plant.damper(NAMES.index(name), v) for v in at])


@pytest.mark.parametrize("name", NAMES)
def test_table_points_are_hit_exactly(plant: Probe, name: str) -> None:
    x, y = points(name)
    off = float(np.abs(curve(plant, name, x) - y).max())
    check = f"{name} curve at the table's points, front wheel, error [N]"
    gate("Dampers", check, "design table", off, at_most(0.0))


@pytest.mark.parametrize("name", NAMES)
def test_inner_stretches_are_scipys_pchip(plant: Probe, name: str) -> None:
    """The last stretch at either end differs: the vehicle's ends take the secant as slope."""
    x, y = points(name)
    at = np.linspace(x[1], x[-2], 4001)
    off = float(np.abs(curve(plant, name, at) - PchipInterpolator(x, y)(at)).max())
    gate("Dampers", f"{name} curve between the table's points, error [N]", "SciPy's PCHIP", off,
         at_most(1e-8))  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_the_force_rises_all_the_way_without_a_jump_in_value_or_slope(
    plant: Probe, name: str
) -> None:
    x, _ = points(name)
    at = np.arange(-1.6 * x[-1], 1.6 * x[-1], 5e-5)
    force = curve(plant, name, at)
    slope = np.diff(force) / np.diff(at)
    assert np.all(slope > 0)
    assert np.max(np.abs(np.diff(force))) < 25e3 * 5e-5  # no secant is steeper than 18 kN s/m
    assert np.max(np.abs(np.diff(slope))) < 0.02 * np.max(slope)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("end", [0, -1], ids=["compression", "rebound"])
def test_beyond_the_table_the_last_secant_goes_on(plant: Probe, name: str, end: int) -> None:
    x, y = points(name)
    inner = 1 if end == 0 else -2
    secant = (y[end] - y[inner]) / (x[end] - x[inner])
    at = x[end] * np.array([1.1, 2.0, 10.0])
    expected = y[end] + secant * (at - x[end])
    assert curve(plant, name, at) == pytest.approx(expected, rel=1e-12)


def test_hard_exceeds_soft_at_every_speed(plant: Probe) -> None:
    at = np.linspace(0.001, 4.0, 500)
    for sign in (1.0, -1.0):
        soft, hard = (np.abs(curve(plant, name, sign * at)) for name in ("soft", "hard"))
        assert np.all(hard > soft)
