"""The vehicle's OpenCRG reader against ASAM's C library (pycrg) and pyopencrg."""

from __future__ import annotations

import ctypes
import math
import os
import subprocess
from pathlib import Path

import numpy as np
import pycrg
import pyopencrg
import pytest
from road_reader import CrgText, Reader, compile_reader, load_library, winding_road

INSIDE = 1.0  # m from the ends, where the three readers take different headings to go straight on


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    return load_library(compile_reader(tmp_path_factory.mktemp("reader") / "road.so"))


@pytest.fixture(autouse=True)
def _quiet() -> None:
    pycrg.set_message_level(0)


def check_against_asam(library: ctypes.CDLL, path: Path, tolerance: float = 1e-9) -> None:
    random = np.random.default_rng(1)
    with Reader.open(library, path) as road, pycrg.DataSet.open(path) as data:
        asam = data.create_contact_point()
        grid = data.grid()
        for _ in range(150):
            u = random.uniform(grid.u[0] - 1.0, grid.u[-1] + 1.0)
            v = random.uniform(1.3 * grid.v[0], 1.3 * grid.v[-1])
            assert road.elevation(u, v) == pytest.approx(asam.uv_to_z(u, v), abs=tolerance)
            if not grid.u[0] + INSIDE < u < grid.u[-1] - INSIDE:
                continue
            x, y = asam.uv_to_xy(u, v)
            assert road.point(u, v) == pytest.approx((x, y), abs=tolerance)
            found = road.locate(x, y)
            assert (found.u, found.v) == pytest.approx(asam.xy_to_uv(x, y), abs=tolerance)
            assert road.elevation(found.u, found.v) == pytest.approx(
                asam.xy_to_z(x, y), abs=tolerance
            )


@pytest.mark.parametrize("form", ["LRFI", "LDFI", "KRBI", "KDBI"])
def test_every_format_reads_as_asam_reads_it(
    library: ctypes.CDLL, tmp_path: Path, form: str
) -> None:
    check_against_asam(library, winding_road(form=form, mods="").write(tmp_path / "road.crg"))


@pytest.mark.parametrize(
    "mods",
    [
        None,
        "",
        "refpoint_u = 14.1\nrefpoint_v = 0.7\nrefpoint_x = 3\nrefpoint_phi = 1",
        "refpoint_u_fraction = 0.5\nrefpoint_u_offset = 0.3\nrefpoint_z = 2",
        "refpoint_v_fraction = 0.5\nrefpoint_v_offset = 0.3\nrefpoint_y = 2",
        "refline_offset_phi = 0.3\nrefline_offset_z = 3",
        "refline_offset_phi = 0.3\nrefline_rotcenter_x = 1\nrefline_rotcenter_y = 2",
        "scale_z_grid = 2\nscale_slope = 3\nscale_banking = 4\nscale_width = 2",
        "scale_length = 1.5\nscale_curvature = 1.5\nscale_slope = 2\nrefpoint_u = 12",
    ],
)
def test_every_modifier_acts_as_in_asams_library(
    library: ctypes.CDLL, tmp_path: Path, mods: str | None
) -> None:
    check_against_asam(library, winding_road(mods=mods).write(tmp_path / "road.crg"))


def test_a_given_end_is_met(library: ctypes.CDLL, tmp_path: Path) -> None:
    text = winding_road(mods="")
    end = "\nreference_line_end_x = 110.5\nreference_line_end_y = -40.1\nreference_line_end_z = 7.1"
    path = text._replace(road=text.road + end).write(tmp_path / "road.crg")
    check_against_asam(library, path)
    with Reader.open(library, path) as road:
        assert road.point(road.range()[1], 0.0) == pytest.approx((110.5, -40.1), abs=1e-9)


def test_cells_without_a_number_take_their_neighbours(library: ctypes.CDLL, tmp_path: Path) -> None:
    text = winding_road()
    for row, cells in ((5, [6]), (7, [10]), (9, [7, 8, 9]), (11, [3, 4])):
        text.data[row, cells] = math.nan
    check_against_asam(library, text.write(tmp_path / "holes.crg"))
    text.data[20:23, 3:] = math.nan  # whole cross sections: the one before
    with Reader.open(library, text.write(tmp_path / "gap.crg")) as road:
        assert math.isfinite(road.elevation(10 + 0.25 * 21, 0.3))


def test_agrees_with_pyopencrg(library: ctypes.CDLL, tmp_path: Path) -> None:
    path = winding_road(mods="").write(tmp_path / "road.crg")
    other = pyopencrg.read(str(path))
    random = np.random.default_rng(2)
    u, v = random.uniform(11.0, 23.0, 200), random.uniform(-3.0, 3.1, 200)
    with Reader.open(library, path) as road:
        mine = [road.elevation(a, b) for a, b in zip(u, v, strict=True)]
        points = [road.point(a, b) for a, b in zip(u, v, strict=True)]
    np.testing.assert_allclose(mine, other.uv_to_z(u, v), atol=1e-8)  # the grid is kept in float32
    np.testing.assert_allclose(points, np.transpose(other.uv_to_xy(u, v)), atol=1e-9)


def test_numbered_columns_constant_banking_and_slope(library: ctypes.CDLL, tmp_path: Path) -> None:
    road = """reference_line_start_u = 0
reference_line_end_u = 2
reference_line_increment = 1
long_section_v_right = -1
long_section_v_left = 1
long_section_v_increment = 1
reference_line_start_b = 0.1
reference_line_start_s = 0.05
reference_line_start_z = 7
reference_line_start_phi = 0.5"""
    channels = [f"long section {i},m" for i in (1, 2, 3)]
    data = np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 3.0], [1.0, 2.0, 4.0]])
    path = CrgText(road, channels, data, mods="").write(tmp_path / "road.crg")
    check_against_asam(library, path)
    with Reader.open(library, path) as reader:
        assert reader.elevation(1.0, 0.5) == pytest.approx(7.05 + 0.05 + 2.5)


def test_u_axis_of_the_channel_definition_stands_in_for_keywords(
    library: ctypes.CDLL, tmp_path: Path
) -> None:
    path = CrgText(
        "", ["long section at v = -1,m", "long section at v = 1,m"], np.zeros((5, 2))
    ).write(tmp_path / "road.crg")
    path.write_text(path.read_text().replace("#:LDFI", "#:LDFI\nU:reference line u,m,5,0.5"))
    with Reader.open(library, path) as road:
        assert road.range() == (5.0, 7.0)


def test_a_file_may_name_another_one(library: ctypes.CDLL, tmp_path: Path) -> None:
    winding_road(mods="refline_offset_z = 99").write(tmp_path / "data.crg")
    outer = tmp_path / "outer.crg"
    outer.write_text("$ROAD_CRG_MODS\nrefline_offset_z = 1\n$\n$ROAD_CRG_FILE\ndata.crg\n$\n")
    plain = winding_road(mods="").write(tmp_path / "plain.crg")
    with Reader.open(library, outer) as moved, Reader.open(library, plain) as road:
        assert moved.elevation(15.0, 0.4) == pytest.approx(road.elevation(15.0, 0.4) + 1.0)


def test_position_and_its_inverse(library: ctypes.CDLL, tmp_path: Path) -> None:
    with Reader.open(library, winding_road(mods="").write(tmp_path / "road.crg")) as road:
        hint = -1
        for u in np.arange(9.0, 26.0, 0.037):
            found = road.locate(*road.point(u, -1.3), hint)
            hint = found.hint
            assert (found.u, found.v) == pytest.approx((u, -1.3), abs=1e-9)
            if 11.0 < u < 24.0:
                assert found.stretch == pytest.approx(
                    1.0 / (1.0 + 1.3 * road.curvature(u)), rel=2e-3
                )
                ahead = np.subtract(road.point(u + 0.05, 0.0), road.point(u - 0.05, 0.0))
                assert found.heading == pytest.approx(math.atan2(ahead[1], ahead[0]), abs=5e-3)


def ring(laps: float, radius: float = 20.0, start: float = -5.0) -> CrgText:
    """A circle to the left that overlaps itself, u = 0 at its lap start."""
    du = 0.25
    u = np.arange(start, laps * 2.0 * math.pi * radius, du)
    data = np.column_stack([u / radius - 0.5 * du / radius, np.outer(u, [0.001, 0.001])])
    data[:, 1:] *= 0.0
    road = f"reference_line_start_u = {start}\nreference_line_increment = {du}\n"
    road += f"reference_line_start_phi = {start / radius}"
    channels = ["reference line phi,rad", "long section at v = -3,m", "long section at v = 3,m"]
    return CrgText(road, channels, data, mods="")


def test_a_hint_keeps_the_lap_and_a_global_search_starts_it(
    library: ctypes.CDLL, tmp_path: Path
) -> None:
    lap = 2.0 * math.pi * 20.0
    with Reader.open(library, ring(1.2).write(tmp_path / "ring.crg")) as road:
        hint = -1
        for u in np.arange(0.0, lap + 15.0, 0.4):
            found = road.locate(*road.point(u, 0.7), hint)
            hint = found.hint
            assert found.u == pytest.approx(u, abs=1e-6)
        assert road.locate(*road.point(lap + 3.0, 0.7)).u == pytest.approx(3.0, abs=0.1)
        assert road.curvature(20.0) == pytest.approx(0.05, rel=1e-6)
        # the heading goes on counting after a whole turn
        assert found.heading == pytest.approx(found.u / 20.0, abs=0.01)


def test_outside_the_grid_the_edge_goes_on(library: ctypes.CDLL, tmp_path: Path) -> None:
    with Reader.open(library, winding_road(mods="").write(tmp_path / "road.crg")) as road:
        first, last = road.range()
        assert road.elevation(first - 5.0, 0.3) == road.elevation(first, 0.3)
        assert road.elevation(last + 5.0, 9.0) == road.elevation(last, 3.1)
        beyond = road.locate(*road.point(last + 4.0, 1.0))
        assert (beyond.u, beyond.v, beyond.stretch) == pytest.approx((last + 4.0, 1.0, 1.0))
        assert road.curvature(last + 4.0) == 0.0


def test_options_that_are_not_followed_are_named(library: ctypes.CDLL, tmp_path: Path) -> None:
    text = winding_road(opts="border_mode_u = 3\nborder_mode_v = 2\ncheck_eps = 1e-6")
    with Reader.open(library, text.write(tmp_path / "road.crg")) as road:
        assert "border_mode_u = 3 is not followed" in road.notes()
        assert "border_mode_v" not in road.notes()


def test_numbers_do_not_depend_on_the_locale(library: ctypes.CDLL, tmp_path: Path) -> None:
    locale_of = ctypes.CDLL(None).setlocale
    locale_of.restype = ctypes.c_char_p
    for name in (b"de_DE.UTF-8", b"de_DE.utf8", b"fr_FR.UTF-8"):
        locale_of(4, name)  # LC_NUMERIC, if the machine has it
    try:
        with Reader.open(library, winding_road(mods="").write(tmp_path / "road.crg")) as road:
            assert road.range() == pytest.approx((10.0, 24.75))
    finally:
        locale_of(4, b"C")


def spoilt(tmp_path: Path, old: str, new: str, **changes: object) -> Path:
    path = winding_road(**changes).write(tmp_path / "road.crg")
    text = path.read_bytes()
    assert old.encode() in text
    path.write_bytes(text.replace(old.encode(), new.encode(), 1))
    return path


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("increment = 0.25", "increment = 0,25", r"road.crg:8: .*does not give a number"),
        ("increment = 0.25", "increment = -1", "increment is -1 m; it must be positive"),
        ("#:LDFI", "#:LDFX", "data format '#:LDFX' is not known; use KRBI"),
        ("line banking", "line bonking", "is not a reference line channel"),
        ("at v = 0.500", "at v = -1.000", "two columns lie at v = -1 m"),
        ("at v = 0.500", "17", "columns are partly numbered"),
        ("at v = 0.500,m", "at v = 0.500", "is no column; write"),
        ("$" * 80, "", "there is no data section"),
        ("END_U = 24.75", "END_U = 99", "announces 357 cross sections but the file holds 60"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(
    library: ctypes.CDLL, tmp_path: Path, old: str, new: str, sentence: str
) -> None:
    with pytest.raises(ValueError, match=sentence) as caught:
        Reader.open(library, spoilt(tmp_path, old, new))
    message = str(caught.value)
    assert message.startswith(str(tmp_path / "road.crg"))
    assert message.endswith((".", "?"))
    assert "\n" not in message


@pytest.mark.parametrize("form", ["LDFI", "KRBI"])
def test_a_cut_file_is_refused(library: ctypes.CDLL, tmp_path: Path, form: str) -> None:
    path = winding_road(form=form).write(tmp_path / "road.crg")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 3 // 4])
    with pytest.raises(ValueError, match=r"cut short|line ends before"):
        Reader.open(library, path)


def test_what_is_no_file_is_refused(library: ctypes.CDLL, tmp_path: Path) -> None:
    for path in (tmp_path / "missing.crg", tmp_path):
        with pytest.raises(ValueError, match=r"cannot be (opened|read)"):
            Reader.open(library, path)


def test_a_file_that_names_itself_is_refused(library: ctypes.CDLL, tmp_path: Path) -> None:
    path = tmp_path / "self.crg"
    path.write_text("$ROAD_CRG_FILE\nself.crg\n$\n")
    with pytest.raises(ValueError, match="from file to file"):
        Reader.open(library, path)


PROGRAM = r"""
#include <math.h>
#include <stdio.h>
#include "road_crg.h"
int main(int count, char **path)
{
    char error[256];
    const double far[] = {-1e300, -3.0, 0.0, 12.3, 1e300, INFINITY, NAN};
    for (int i = 1; i < count; ++i) {
        Road *road = road_load(path[i], error, sizeof error);
        if (!road && !error[0])
            return 1;
        for (int k = 0; road && k < 49; ++k) {
            RoadPosition at;
            double x, y;
            int hint = k - 1;
            road_elevation(road, far[k % 7], far[k / 7]);
            road_curvature(road, far[k % 7]);
            road_point(road, far[k % 7], far[k / 7], &x, &y);
            road_locate(road, far[k % 7], far[k / 7], &hint, &at);
        }
        printf("%s\n", road ? road_notes(road) : error);
        road_free(road);
    }
    return 0;
}
"""


def garbled(whole: bytes, random: np.random.Generator) -> bytes:
    """Cut, overwritten, doubled or shuffled pieces of a file."""
    data = bytearray(whole)
    for _ in range(int(random.integers(1, 6))):
        at, size = int(random.integers(0, len(data))), int(random.integers(1, 40))
        kind = random.integers(0, 5)
        if kind == 0:
            del data[at:]
        elif kind == 1:
            data[at : at + size] = random.bytes(size)
        elif kind == 2:
            data[at:at] = data[at : at + 10 * size]
        elif kind == 3:
            del data[at : at + size]
        else:
            data[at : at + 1] = (b"-", b"9", b"e", b"\n", b"=", b"$", b"\0", b"1e308")[size % 8]
        if not data:
            return b""
    return bytes(data)


def test_garbled_files_never_crash(tmp_path: Path) -> None:
    source = tmp_path / "main.c"
    source.write_text(PROGRAM)
    sanitizers = "-fsanitize=address,undefined,float-cast-overflow"
    try:
        program = compile_reader(
            tmp_path / "main", "-g", sanitizers, "-fno-sanitize-recover=all", program=source
        )
    except subprocess.CalledProcessError:
        pytest.skip("the compiler has no sanitizers")
    random = np.random.default_rng(3)
    mods = "refpoint_u = 12\nscale_width = 2\nscale_length = 2\nrefpoint_v_fraction = 0.1"
    path = tmp_path / "whole.crg"
    wholes = [
        winding_road(form=form, mods=mods, opts="border_mode_v = 1").write(path).read_bytes()
        for form in ("LRFI", "LDFI", "KRBI", "KDBI")
    ]
    heads = [whole[: whole.index(b"$" * 80) + 200] for whole in wholes]  # hit the header more often
    paths = []
    for i in range(400):
        paths.append(tmp_path / f"{i}.crg")
        whole = wholes[i % 4]
        head = len(heads[i % 4])
        bad = garbled(whole[:head], random) + whole[head:] if i % 3 else garbled(whole, random)
        paths[-1].write_bytes(bad)
    environment = {**os.environ, "ASAN_OPTIONS": "allocator_may_return_null=1"}
    run = subprocess.run(
        [str(program), *map(str, paths)], capture_output=True, check=False, env=environment
    )
    assert run.returncode == 0, run.stderr.decode(errors="replace")[:3000]
    assert len(run.stdout.splitlines()) >= len(paths)
