"""Lives of the FMUs and random calls under AddressSanitizer, UBSan and the leak check.

`make sanitize` asks for more calls (FUZZ_CALLS, to each FMI version).
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import shipped_fmus as fmus
from fmu_face import FIXTURE, ROOT, build, toolchain
from vehicle_rig import cosine_bump, straight_road

CALLS = int(os.environ.get("FUZZ_CALLS", "20000"))
SEEDS = (1, 2)

Programs = dict[tuple[str, int], Path]
Run = Callable[..., str]


def programs(model: Path, folder: Path) -> Programs:
    try:
        return build.trial_programs(model, folder, None, toolchain.SANITIZE)
    except toolchain.BuildError as error:
        if "asan" in str(error) or "ubsan" in str(error):
            pytest.skip("the compiler has no sanitizers")
        raise


@pytest.fixture(scope="module")
def lag(tmp_path_factory: pytest.TempPathFactory) -> Programs:
    return programs(FIXTURE, tmp_path_factory.mktemp("lag"))


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory: pytest.TempPathFactory) -> Programs:
    return programs(ROOT / "fmu" / "vehicle", tmp_path_factory.mktemp("vehicle"))


@pytest.fixture(scope="module")
def sensor(tmp_path_factory: pytest.TempPathFactory) -> Programs:
    return programs(ROOT / "fmu" / "sensor", tmp_path_factory.mktemp("sensor"))


@pytest.fixture(params=fmus.KINDS)
def network(request: pytest.FixtureRequest) -> Iterator[tuple[str, str]]:
    """Where the programs find a small network, and the token that goes with it."""
    fmu = fmus.Shipped(f"small {request.param}", 3)
    with fmus.unzipped(fmu) as folder:
        token = fmus.xml(fmu).get("instantiationToken")
        yield f"--resources={folder / 'resources'}", f"--token={token}"


@pytest.fixture(scope="module")
def road(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("road") / "bump.crg"
    return straight_road(path, lambda s, v: cosine_bump(s, 2.0, 3.0, 0.05) + 0.01 * v)


def run(program: Path, *arguments: str) -> str:
    """What a program says that ends well; a leak or a fault is in its words otherwise."""
    result = subprocess.run(
        [program, *arguments], capture_output=True, text=True, errors="replace", check=False
    )
    assert result.returncode == 0, result.stderr[-4000:]
    print(result.stdout.strip())
    return result.stdout


@pytest.mark.parametrize("version", [2, 3])
def test_lives_leave_nothing_behind(lag: Programs, version: int) -> None:
    setting = f"Gain.File={FIXTURE / 'resources' / 'gain.txt'}"
    said = run(lag["smoke", version], "--lives=20", "--instances=2000", setting)
    assert "20 lives of Lag and 2000 instances more, no fault" in said


@pytest.mark.parametrize("version", [2, 3])
def test_lives_of_the_vehicle_leave_nothing_behind(
    vehicle: Programs, version: int, road: str
) -> None:
    """On a road, moving: 2000 instances and 20 whole lives."""
    arguments = ("--lives=20", "--instances=2000", f"Road.File={road}", "Init.Velocity=15")
    assert "no fault" in run(vehicle["smoke", version], *arguments)


@pytest.mark.parametrize("version", [2, 3])
def test_lives_of_a_sensor_leave_nothing_behind(
    sensor: Programs, version: int, network: tuple[str, str]
) -> None:
    arguments = ("--lives=20", "--instances=2000", "Car.vx=15", "Car.az=-2", *network)
    assert "20 lives of Sensor and 2000 instances more, no fault" in run(
        sensor["smoke", version], *arguments
    )


@pytest.mark.parametrize("version", [2, 3])
def test_random_calls_of_a_sensor(sensor: Programs, version: int, network: tuple[str, str]) -> None:
    said = run(sensor["fuzz", version], "1", str(CALLS), *network)
    assert said == f"FMI {version}: {CALLS} random calls of Sensor, no fault\n"


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("seed", SEEDS)
def test_random_calls(lag: Programs, version: int, seed: int) -> None:
    said = run(lag["fuzz", version], str(seed), str(CALLS))
    assert said == f"FMI {version}: {CALLS} random calls of Lag, no fault\n"


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("seed", SEEDS)
def test_random_calls_of_the_vehicle(vehicle: Programs, version: int, seed: int, road: str) -> None:
    said = run(vehicle["fuzz", version], str(seed), str(CALLS), road)
    assert said == f"FMI {version}: {CALLS} random calls of Vehicle, no fault\n"
