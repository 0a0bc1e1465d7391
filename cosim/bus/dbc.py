"""The DBC of the bus, written from the table of its frames.

`python -m cosim.bus.dbc > cosim/bus/suspension.dbc` writes the file that is shipped.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from cosim.bus.messages import BENCH, CYCLE_MS, FRAMES, SENSOR, BusSignal, Frame

DBC: Final = Path(__file__).with_name("suspension.dbc")
NO_VALUE: Final = "no value"


def dbc_text() -> str:
    """Return the DBC."""
    lines = ['VERSION "1"', "", "NS_ :", "", "BS_:", "", f"BU_: {BENCH} {SENSOR}", ""]
    for frame in FRAMES:
        lines += [*_frame(frame), ""]
    lines += [line for frame in FRAMES for line in _comments(frame)]
    lines += ["", 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;']
    lines += ['BA_DEF_DEF_ "GenMsgCycleTime" 0;']
    lines += [
        f'BA_ "GenMsgCycleTime" BO_ {frame.identifier} {CYCLE_MS};'
        for frame in FRAMES
        if frame.cyclic
    ]
    lines += ["", *(line for frame in FRAMES for line in _values(frame))]
    return "\n".join(lines) + "\n"


def _frame(frame: Frame) -> Iterator[str]:
    yield f"BO_ {frame.identifier} {frame.name}: {frame.size} {frame.sender}"
    start = 0
    for signal in frame.signals:
        yield f" SG_ {signal.name} : {start}|{_number(signal)} {frame.receiver}"
        start += signal.bits


def _number(signal: BusSignal) -> str:
    """Return length, byte order, sign, scale, range and unit of a signal."""
    sign = "-" if signal.signed else "+"
    if signal.coding is None:
        return f'{signal.bits}@1{sign} (1,0) [0|{(1 << signal.bits) - 1}] ""'
    step = signal.coding.step
    low, high = (f"{raw * step:.12g}" for raw in signal.coding.raw_range)
    return f'{signal.bits}@1{sign} ({step!r},0) [{low}|{high}] "{signal.coding.unit}"'


def _comments(frame: Frame) -> Iterator[str]:
    yield f'CM_ BO_ {frame.identifier} "{frame.description}";'
    for signal in frame.signals:
        yield f'CM_ SG_ {frame.identifier} {signal.name} "{signal.description}";'


def _values(frame: Frame) -> Iterator[str]:
    for signal in frame.signals:
        words = signal.words
        if signal.coding is not None:
            words += ((signal.coding.no_value, NO_VALUE),)
        if words:
            text = " ".join(f'{raw} "{word}"' for raw, word in words)
            yield f"VAL_ {frame.identifier} {signal.name} {text} ;"


if __name__ == "__main__":
    sys.stdout.write(dbc_text())
