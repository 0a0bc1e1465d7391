"""A road file for a track and a surface, built once and kept in a cache."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from uuid import uuid4

from cosim.cache import default_cache_dir
from cosim.road.crg import WRITER_VERSION, write_crg
from cosim.road.errors import RoadError
from cosim.road.grid import road_grid
from cosim.road.obstacles import Obstacle
from cosim.road.surface import Surface
from cosim.road.track import Track


def build_road(
    track: Track,
    surface: Surface,
    cache_dir: Path | None = None,
    obstacles: Sequence[Obstacle] = (),
) -> Path:
    """Return the OpenCRG file of `track` with `surface` and the `obstacles` laid over it, from
    `cache_dir` if it was built before.

    The file's name carries a hash of all that it is made from, and it appears whole or not at all,
    so any number of processes may build the same road. Raises `RoadError` if the cache cannot be
    written or the road would be too large.
    """
    directory = default_cache_dir() if cache_dir is None else cache_dir
    label = f"{surface.label}-obstacles" if obstacles else surface.label
    path = directory / f"{track.name}-{label}-{_key(track, surface, obstacles)[:16]}.crg"
    if path.is_file():
        return path
    grid = road_grid(track.s, surface, obstacles)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        unfinished = directory / f".{path.stem}-{uuid4().hex}.crg"
        try:
            write_crg(unfinished, track, grid)
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)
    except OSError as error:
        raise RoadError(
            f"the road cannot be kept in {directory} ({error.strerror}); "
            "set COSIM_CACHE_DIR to a directory that can be written"
        ) from error
    return path


def _key(track: Track, surface: Surface, obstacles: Sequence[Obstacle]) -> str:
    digest = hashlib.sha256(f"{WRITER_VERSION} {track.name} {track.length!r}".encode())
    for line in (track.s, *track.lines()):
        digest.update(line.tobytes())
    digest.update(surface.columns(track.s).tobytes())
    digest.update(repr((surface, *obstacles)).encode())
    return digest.hexdigest()
