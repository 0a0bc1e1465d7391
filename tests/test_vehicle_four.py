"""The plant's own elementary functions (fmu/vehicle/four.h) against the C library's."""

import numpy as np
import pytest
from plant_probe import Probe

EPS = np.finfo(float).eps
REACH = np.linspace(-20.0, 20.0, 400_001)


@pytest.fixture(scope="module")
def probe() -> Probe:
    return Probe()


@pytest.mark.parametrize(("which", "exact"), [(0, np.sin), (1, np.cos)], ids=["sine", "cosine"])
def test_trigonometry_is_exact_to_round_off_of_one(
    probe: Probe, which: int, exact: np.ufunc
) -> None:
    assert np.abs(probe.elementary(which, REACH) - exact(REACH)).max() < 3 * EPS


def test_trigonometry_holds_over_many_turns(probe: Probe) -> None:
    x = np.random.default_rng(1).uniform(-1e5, 1e5, 100_000)
    assert np.abs(probe.elementary(0, x) - np.sin(x)).max() < 1e-11


def test_small_sines_keep_their_digits(probe: Probe) -> None:
    x = np.geomspace(1e-12, 0.5, 10_000)
    assert np.abs(probe.elementary(0, x) / np.sin(x) - 1).max() < 3 * EPS


def test_the_arctangent_is_exact_to_round_off(probe: Probe) -> None:
    x = np.concatenate([np.geomspace(1e-12, 1e12, 200_001), REACH[REACH != 0]])
    assert np.abs(probe.elementary(2, x) / np.arctan(x) - 1).max() < 3 * EPS
    np.testing.assert_array_equal(probe.elementary(2, -x), -probe.elementary(2, x))
    assert probe.elementary(2, np.array([0.0])) == [0.0]


def test_the_exponential_is_exact_to_round_off(probe: Probe) -> None:
    assert np.abs(probe.elementary(3, REACH) / np.exp(REACH) - 1).max() < 3 * EPS
