"""What every test is given, and `--validation FOLDER`: slow gates too, their page and pictures."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from pathlib import Path

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--validation", type=Path, help="run the slow gates too; write their page and plots here"
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--validation"):
        return
    slow = [item for item in items if item.get_closest_marker("validation")]
    config.hook.pytest_deselected(items=slow)
    items[:] = [item for item in items if item not in slow]


def pytest_sessionfinish(session: pytest.Session) -> None:
    folder = session.config.getoption("--validation")
    if folder:
        from gates import write_page

        write_page(folder)


@pytest.fixture(scope="session")
def plots(request: pytest.FixtureRequest) -> Path | None:
    """Folder for the plots of `make validation`; None in the test suite."""
    folder: Path | None = request.config.getoption("--validation")
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture(scope="session", autouse=True)
def _road_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the roads that tests build out of the user's cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COSIM_CACHE_DIR", str(tmp_path_factory.mktemp("roads")))
        yield


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """The small model of tests/fmu_fixture as an FMU of FMI 2.0 and of FMI 3.0, built once."""
    from fmu_face import FIXTURE, build

    paths = build.build(FIXTURE, tmp_path_factory.mktemp("lag"))
    return dict(zip((2, 3), paths, strict=True))


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def version(request: pytest.FixtureRequest) -> int:
    """The major version of FMI."""
    return int(request.param)


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The C sensor, without FMI, as a shared library, compiled once."""
    from packed_sensor import compile_sensor, load_library

    return load_library(compile_sensor(tmp_path_factory.mktemp("sensor") / "sensor.so"))
