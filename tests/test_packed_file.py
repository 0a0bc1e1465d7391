"""Packed networks that are damaged, and all of the C sensor under AddressSanitizer and UBSan."""

from __future__ import annotations

import ctypes
import struct
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from packed_sensor import (
    FLAGS,
    PackedSensor,
    aligned,
    carried_network,
    compile_sensor,
    drive,
    exported,
    kernels,
    windowed_network,
)

from sensor.packed import blob, read_network

CHECKED = 24  # bytes; what stands before is checked by itself
PROGRAM = Path(__file__).with_name("packed_run.c")
SANITIZERS = ["-g", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]


@pytest.fixture(scope="module")
def windowed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = exported(windowed_network(5, 18, 7, True), tmp_path_factory.mktemp("windowed"))
    return blob(read_network(path))


@pytest.fixture(scope="module")
def carried(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = exported(carried_network(5, 18, 7), tmp_path_factory.mktemp("carried"))
    return blob(read_network(path))


def opened(library: ctypes.CDLL, content: bytes) -> str:
    """Return what the C sensor says against a file, nothing if it takes it."""
    try:
        PackedSensor(library, content)
    except ValueError as error:
        return str(error)
    return ""


def with_word(content: bytes, place: int, value: int) -> bytes:
    return content[:place] + struct.pack("<I", value) + content[place + 4 :]


def test_a_whole_file_is_taken(library: ctypes.CDLL, windowed: bytes, carried: bytes) -> None:
    assert opened(library, windowed) == opened(library, carried) == ""


def test_what_is_wrong_is_said(library: ctypes.CDLL, windowed: bytes) -> None:
    changed = bytearray(windowed)
    changed[len(changed) // 2] ^= 4
    for content, said in (
        (b"PK", "no packed network"),
        (b"PK" + windowed[2:], "no packed network"),
        (windowed[:-64], "cut short"),
        (windowed + bytes(64), "prolonged"),
        (with_word(windowed, 8, 0x04030201), "byte order"),
        (with_word(windowed, 12, 99), "another version"),
        (bytes(changed), "checksum"),
        (with_checksum(with_word(windowed, 24, 2)), "shape"),
        (with_checksum(with_word(windowed, 32, 33)), "do not agree"),
    ):
        assert said in opened(library, content)


def test_a_file_at_an_odd_address_is_refused(library: ctypes.CDLL, windowed: bytes) -> None:
    room = aligned(len(windowed), 8)
    room[:] = np.frombuffer(windowed, dtype=np.uint8)
    network = aligned(512)
    said = library.network_open(network.ctypes.data, room.ctypes.data, len(windowed))
    assert b"multiple of 64" in said


def with_checksum(content: bytes) -> bytes:
    return with_word(content, 20, zlib.crc32(content[CHECKED:]))


@pytest.mark.parametrize("place", range(CHECKED, 64, 4))
def test_the_checksum_covers_the_head(library: ctypes.CDLL, windowed: bytes, place: int) -> None:
    assert "checksum" in opened(library, with_word(windowed, place, 1234))


@settings(max_examples=300, deadline=None)
@given(
    place=st.sampled_from(range(CHECKED, 64, 4)),
    value=st.integers(0, 100) | st.integers(0, 2**32 - 1),
)
def test_a_head_that_lies_with_a_right_checksum_is_refused_or_does_no_harm(
    library: ctypes.CDLL, windowed: bytes, carried: bytes, place: int, value: int
) -> None:
    channels, commands = drive(10)
    for content in (windowed, carried):
        lying = with_checksum(with_word(content, place, value))
        if not opened(library, lying):
            PackedSensor(library, lying).run(channels, commands)


@pytest.fixture(scope="module")
def sanitized(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("sanitized") / "packed_run"
    try:
        return compile_sensor(target, "-O0", *SANITIZERS, program=PROGRAM)
    except subprocess.CalledProcessError:
        pytest.skip("the compiler has no sanitizers")


def said_by(*command: str | Path) -> str:
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr[-3000:]
    return run.stdout


@pytest.mark.parametrize("kind", ["windowed", "carried"])
def test_the_sanitizers_have_nothing_to_say(
    library: ctypes.CDLL,
    sanitized: Path,
    tmp_path: Path,
    kind: str,
    request: pytest.FixtureRequest,
) -> None:
    content = request.getfixturevalue(kind)
    channels, commands = drive(120)
    channels[60, 3], channels[80] = np.nan, 1e38
    (tmp_path / "network.bin").write_bytes(content)
    (tmp_path / "samples.bin").write_bytes(np.hstack([channels, commands]).tobytes())
    for kernel in kernels(library):
        files = [tmp_path / "network.bin", tmp_path / "samples.bin"]
        assert said_by(sanitized, *files, kernel).count("\n") > 40
    for size in (0, 10, 63, 64, 200, len(content) - 64):
        (tmp_path / "network.bin").write_bytes(content[:size])
        run = subprocess.run(
            [sanitized, *files, kernel], capture_output=True, text=True, check=False
        )
        assert run.returncode == 0, run.stderr[-3000:]
        assert run.stdout


def test_it_is_c99_too_and_free_of_warnings(tmp_path: Path) -> None:
    assert "-Werror" in FLAGS
    compile_sensor(tmp_path / "sensor.so", "-std=c99", "-pedantic", "-O1", "-ffp-contract=fast")
