"""The frames of the bus as a Markdown table, from the DBC, and the load that they are. The counter
that all cyclic frames begin with is left out.

`python -m cosim.bus.frame_table` prints the table of docs/can.md.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from cosim.bus.codec import database
from cosim.bus.messages import COUNTER

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal

BITRATE: Final = 500_000.0
OVERHEAD: Final = 47
"""Bits of a classic frame with 11-bit identifier beside its data, the pause after it included."""
STUFFED: Final = 34
"""Those of them that bit stuffing counts (ISO 11898-1: from the start of frame to the CRC)."""


def frame_table() -> str:
    """Return the table: a line per frame and per signal."""
    lines = [
        "| frame, signal | bits | unit | step | range | what |\n",
        "|---|---|---|---:|---|---|\n",
    ]
    for message in database().messages:
        lines += _lines(message)
    return "".join(lines)


def _lines(message: Message) -> Iterator[str]:
    cycle = "on demand" if message.cycle_time is None else f"every {message.cycle_time} ms"
    yield (
        f"| **{message.name}** `0x{message.frame_id:03X}` | {8 * message.length} | | | "
        f"{message.senders[0]}, {cycle} | {message.comment} |\n"
    )
    for signal in message.signals:
        if signal.name == COUNTER.name:
            continue
        yield f"| {signal.name} | {signal.length} | {_number(signal)} | {signal.comment} |\n"


def _number(signal: Signal) -> str:
    """Return unit, step and range of a signal, its words where it has no unit and no step."""
    if signal.scale == 1:
        words = ", ".join(f"{raw} {word}" for raw, word in (signal.choices or {}).items())
        return f" | | {words or f'0 to {(1 << signal.length) - 1}'}"
    low, high = float(signal.minimum or 0.0), float(signal.maximum or 0.0)
    return f"{signal.unit or '1'} | {float(signal.scale):.4g} | {low:.5g} to {high:.5g}"


def bus_load_percent() -> float:
    """Return the largest load of the cyclic frames on a bus of 500 kbit/s [%], with as many stuff
    bits as there can be.
    """
    seconds = 0.0
    for message in database().messages:
        if message.cycle_time:
            data = 8 * message.length
            bits = OVERHEAD + data + (STUFFED + data - 1) // 4
            seconds += bits / BITRATE * (1000.0 / message.cycle_time)
    return 100.0 * seconds


if __name__ == "__main__":
    sys.stdout.write(frame_table())
