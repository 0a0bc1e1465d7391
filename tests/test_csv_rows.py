"""Numbers as text, byte for byte what repr() writes (cosim.csv_rows, fmu/csv)."""

from __future__ import annotations

import math
from fractions import Fraction
from importlib import import_module

import numpy as np
import numpy.typing as npt
import pytest
from fmu_face import ROOT
from hypothesis import example, given, settings
from hypothesis import strategies as st

from cosim.csv_rows import csv_lines

Array = npt.NDArray[np.float64]

assert (ROOT / "fmu").is_dir()  # importing fmu_face has put its scripts on the path
csv_powers = import_module("csv_powers")


def text(data: Array) -> bytes:
    return b"".join(bytes(lines) for lines in csv_lines(data))


def by_repr(data: Array) -> bytes:
    return "".join(",".join(map(repr, row.tolist())) + "\n" for row in data).encode()


@given(st.floats())
@example(5e-324)
@example(1.7976931348623157e308)
@example(2.2250738585072014e-308)
@example(9007199254740993.0)
@example(1e16)
@example(1e-5)
@example(-0.0)
@settings(max_examples=2000)
def test_a_number_is_what_repr_writes(number: float) -> None:
    assert text(np.array([[number]])) == repr(number).encode() + b"\n"


def test_numbers_of_every_size_and_exact_ones() -> None:
    """Any bits; powers of two, whose neighbours are not equally far; powers of ten; hundredths."""
    random = np.random.default_rng(3)
    bits = random.integers(0, 2**64, (20_000, 10), dtype=np.uint64)
    exact = [float(2.0**k) for k in range(-1074, 1024)] + [
        float(f"1e{k}") for k in range(-323, 309)
    ]
    exact += [0.01 * k for k in range(20_000)] + [float(k) for k in range(2000)]
    single = random.normal(size=(2000, 10)).astype(np.float32).astype(np.float64)
    for data in (bits.view(np.float64), np.array(exact)[:, None], single):
        assert text(data) == by_repr(data)


def test_rows_and_columns_keep_their_places() -> None:
    """More rows than are written at once, and a slice that does not lie together."""
    data = np.arange(6006.0).reshape(1001, 6)[:, 1:4] / 7
    assert text(data) == by_repr(data)
    assert text(np.empty((0, 3))) == b""


def test_the_widest_number_fits() -> None:
    widest = -2.2250738585072014e-308
    data = np.full((500, 40), widest)
    assert len(repr(widest)) == 24
    assert text(data) == by_repr(data)


@pytest.mark.parametrize("k", [-292, -100, -1, 0, 1, 55, 56, 324])
def test_powers_of_ten(k: int) -> None:
    exact = Fraction(10) ** k
    r = math.floor(math.log2(exact.numerator) - math.log2(exact.denominator)) - 127
    assert csv_powers.power(k) == math.floor(exact / Fraction(2) ** r) + 1
    assert csv_powers.power(k).bit_length() == 128
