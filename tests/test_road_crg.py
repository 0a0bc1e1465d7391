"""Road files: written, cached, read back by three OpenCRG readers (cosim.road.crg, .build)."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

import numpy as np
import pycrg
import pyopencrg
import pytest
from gates import at_most, gate
from road_reader import Reader, compile_reader, load_library

from cosim.cache import default_cache_dir
from cosim.road import Iso8608, RoadError, Smooth, Track, build_road, load_track


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return load_library(compile_reader(tmp_path_factory.mktemp("reader") / "road.so"))


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("roads")


@pytest.fixture(scope="module")
def track() -> Track:
    return load_track("hockenheim")


def sample_places(track: Track) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(4)
    u = random.uniform(track.s[0] + 1.0, track.s[-1] - 1.0, 400)
    u[:100] = random.uniform(1700.0, 2300.0, 100)  # banking and dip
    return u, random.uniform(-4.4, 4.4, 400)


def test_three_readers_find_the_same_road(library: ctypes.CDLL, cache: Path, track: Track) -> None:
    path = build_road(track, Iso8608("C", 1), cache)
    other = pyopencrg.read(str(path))
    assert not other.check().errors
    places = list(zip(*sample_places(track), strict=True))
    with Reader.open(library, path) as road, pycrg.DataSet.open(path, check=True) as data:
        asam = data.create_contact_point()
        assert road.notes() == ""
        own = np.array([(road.elevation(u, v), *road.point(u, v)) for u, v in places])
        by_asam = np.array([(asam.uv_to_z(u, v), *asam.uv_to_xy(u, v)) for u, v in places])
        readings = [(other.uv_to_z(u, v), *other.uv_to_xy(u, v)) for u, v in places]
        by_other = np.array(readings, dtype=float)
    check = "Hockenheim, class C, 400 places: elevation and x, y, largest difference [m]"
    for oracle, found, most in (("ASAM's C API (pycrg)", by_asam, 1e-9),
                                ("pyopencrg", by_other, 1e-7)):  # fmt: skip
        off = np.abs(own - found)
        measured = [off[:, 0].max(), off[:, 1:].max()]
        gate("Roads", f"{check}, {oracle}", oracle, measured, at_most(most))


def test_the_file_lies_where_the_track_lies(
    library: ctypes.CDLL, cache: Path, track: Track
) -> None:
    with Reader.open(library, build_road(track, Smooth(), cache)) as road:
        assert road.range() == pytest.approx((track.s[0], track.s[-1]))
        hint = -1
        for s in np.arange(0.0, track.length, 11.3):
            pose = track.pose(s)
            assert road.point(s, 0.0) == pytest.approx((pose.x, pose.y), abs=2e-3)
            assert road.elevation(s, 0.0) == pytest.approx(pose.z, abs=1e-4)
            assert road.elevation(s, 1.0) == pytest.approx(pose.z + pose.banking, abs=1e-4)
            assert road.curvature(s) == pytest.approx(pose.curvature, abs=2e-4)
            found = road.locate(pose.x, pose.y, hint)
            hint = found.hint
            assert found.u == pytest.approx(s, abs=2e-3)
            assert found.heading == pytest.approx(pose.heading, abs=1e-4)


def test_the_start_of_a_circuit_is_found_before_its_end(
    library: ctypes.CDLL, cache: Path, track: Track
) -> None:
    with Reader.open(library, build_road(track, Smooth(), cache)) as road:
        for s in (-15.0, 0.0, 1.439, 30.0):
            pose = track.pose(s)
            assert road.locate(pose.x, pose.y + 0.8).u == pytest.approx(s, abs=0.01)


def test_single_precision_does_not_shake_the_car(library: ctypes.CDLL, cache: Path) -> None:
    track = load_track("heilbronn")
    with Reader.open(library, build_road(track, Smooth(), cache)) as road:
        s = np.arange(3000.0, 3100.0, 0.05)
        z = np.array([road.elevation(q, 0.8) for q in s])
        exact = np.array([track.pose(q).z + 0.8 * track.pose(q).banking for q in s])
        error = z - exact
        assert np.abs(error - error.mean()).max() < 1e-6
        assert np.abs(error).max() < 1e-3


def test_a_road_is_built_once(cache: Path) -> None:
    track = load_track("straight", 50.0)
    path = build_road(track, Iso8608("A", 1), cache)
    before = path.stat().st_mtime_ns
    assert build_road(track, Iso8608("A", 1), cache) == path
    assert path.stat().st_mtime_ns == before
    assert build_road(track, Iso8608("A", 2), cache) != path
    assert build_road(load_track("straight", 60.0), Iso8608("A", 1), cache) != path
    assert not list(cache.glob(".*"))


def test_the_same_road_has_the_same_bytes(tmp_path: Path) -> None:
    track = load_track("straight", 50.0)
    files = [build_road(track, Iso8608("B", 3), tmp_path / name) for name in ("a", "b")]
    assert files[0].read_bytes() == files[1].read_bytes()
    assert files[0].name == files[1].name


def test_the_cache_is_named_by_the_environment(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("COSIM_CACHE_DIR", str(tmp_path / "kept"))
    assert build_road(load_track("straight", 50.0), Smooth()).parent == tmp_path / "kept"
    monkeypatch.delenv("COSIM_CACHE_DIR")
    assert default_cache_dir() == Path.home() / ".cache" / "suspension-cosim"


def test_a_cache_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RoadError, match="set COSIM_CACHE_DIR"):
        build_road(load_track("straight", 50.0), Smooth(), tmp_path / "file" / "below")


def test_a_failed_build_leaves_nothing_behind(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr("cosim.road.build.write_crg", fail)
    with pytest.raises(RoadError, match="No space left"):
        build_road(load_track("straight", 50.0), Smooth(), tmp_path)
    assert not list(tmp_path.iterdir())
