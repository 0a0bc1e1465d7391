"""What every test is given."""

from __future__ import annotations

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="session", autouse=True)
def _road_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the roads that tests build out of the user's cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COSIM_CACHE_DIR", str(tmp_path_factory.mktemp("roads")))
        yield
