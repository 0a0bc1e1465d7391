"""Corners four at a time (fmu/vehicle/four.h): elementary functions; the same bits everywhere."""

from pathlib import Path

import numpy as np
import pytest
from fmu_face import ROOT, build
from plant_probe import Probe
from vehicle_rig import INPUTS, output_names

from cosim.fmi import Description, Slave
from cosim.road import Iso8608, build_road, load_track
from cosim.vehicle import builtin_fmu

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


def driven(fmu: Path, road: Path) -> bytes:
    """Every output after each of 100 steps with moving inputs."""
    slave = Slave(Description(fmu), INPUTS, output_names())
    slave.initialise({"Road.File": str(road), "Init.Velocity": 15.0})
    rows = []
    for k in range(100):
        slave.inputs[:] = [0.02 * k, 0.5, 0.1 * (k > 50), 1.0, 0.3, 0.6, 0.01 * k, 1.0]
        slave.step(k, 0.01)
        slave.read()
        rows.append(slave.outputs.tobytes())
    slave.close()
    return b"".join(rows)


def test_a_processor_without_avx2_gives_the_same_bits(tmp_path: Path) -> None:
    road = build_road(load_track("straight", 60.0), Iso8608("C", 1), tmp_path)
    plain = build.build(ROOT / "fmu" / "vehicle", tmp_path, cflags="-DWITHOUT_AVX2")[1]
    assert driven(plain, road) == driven(builtin_fmu(3), road)
