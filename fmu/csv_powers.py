"""The table of powers of ten that `csv/csv_rows.c` scales with, as a C header.

g(k) = floor(10^k 2^-r) + 1 with r = floor(log2 10^k) - 127: 128 bits, high word first (Giulietti,
"The Schubfach way to render doubles", 2020, section 9).
"""

from __future__ import annotations

FIRST, LAST = -292, 324  # from the largest double to the smallest


def power(k: int) -> int:
    """g(k)."""
    over, under = (10**k, 1) if k >= 0 else (1, 10**-k)
    # floor(log2(over / under)): the estimate from the lengths is right or one too high
    exponent = over.bit_length() - under.bit_length()
    if (over << -exponent if exponent < 0 else over) < (
        under << exponent if exponent > 0 else under
    ):
        exponent -= 1
    r = exponent - 127
    return (over << -r if r < 0 else over) // (under << r if r > 0 else under) + 1


def header() -> str:
    """The C header `csv_powers.h`."""
    rows = [
        f"    {{{g >> 64:#018x}, {g & 2**64 - 1:#018x}}}, /* {k} */"
        for k in range(FIRST, LAST + 1)
        for g in [power(k)]
    ]
    return "\n".join(
        [
            "/* Written by fmu/csv_powers.py. */",
            f"enum {{ FIRST_POWER = {FIRST} }};",
            f"static const uint64_t powers[{LAST - FIRST + 1}][2] = {{",
            *rows,
            "};",
            "",
        ]
    )
