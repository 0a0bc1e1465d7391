"""Values in SI units to CAN data and back, by the shipped DBC and cantools."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from cosim.bus.dbc import DBC, NO_VALUE
from cosim.bus.messages import (
    AGE,
    AGE_OF_ANSWER,
    COUNTER,
    FROM_SENSOR,
    TO_SENSOR,
    UNITS,
    VALID,
    Frame,
    bus_name,
    deviation_name,
)
from sensor.channels import CHANNELS, COMMANDS, OUTPUTS

if TYPE_CHECKING:
    from cantools.database.can import Database, Message, Signal

Array: TypeAlias = npt.NDArray[np.float64]
Data: TypeAlias = tuple[int, bytes]  # identifier of a frame, and its data

GIVEN: Final = tuple(c.name for c in (*CHANNELS, *COMMANDS))
"""What the sensor is given, in the order of `sensor_input`."""
ANSWERED: Final = (*(o.name for o in OUTPUTS), *(deviation_name(o) for o in OUTPUTS))
"""What it answers with, in the order of `sensor_output`."""


@cache
def database() -> Database:
    """Return the shipped DBC."""
    from cantools.database import load_file
    from cantools.database.can import Database

    loaded = load_file(DBC)
    assert isinstance(loaded, Database)
    return loaded


class FrameSet:
    """The frames that carry one vector of quantities, a sample's.

    `out_of_range` counts the values that were beyond what their signals can say; those are sent as
    the nearest that they can.
    """

    def __init__(self, frames: Sequence[Frame], quantities: Sequence[str]) -> None:
        messages = [database().get_message_by_frame_id(frame.identifier) for frame in frames]
        self.identifiers = tuple(message.frame_id for message in messages)
        self.out_of_range = 0
        self._messages = dict(zip(self.identifiers, messages, strict=True))
        self.places = {
            identifier: tuple(
                (i, name)
                for i, name in enumerate(map(bus_name, quantities))
                if name in message.signal_tree
            )
            for identifier, message in self._messages.items()
        }
        signals = [_signal(messages, bus_name(name)) for name in quantities]
        self.step = np.array([float(s.scale) * UNITS[s.unit or ""][1] for s in signals])
        """Value of one raw step, (quantities,), SI units."""
        self._none = np.array([_no_value(signal) for signal in signals], dtype=np.float64)
        self.low = np.array([round(float(s.minimum or 0.0) / float(s.scale)) for s in signals])
        self.high = np.array([round(float(s.maximum or 0.0) / float(s.scale)) for s in signals])

    def encode(self, values: Array, **others: int) -> list[Data]:
        """Return the frames of one vector in SI units, NaN and infinity as "no value"; `others` are
        raw values of further signals, for the frames that have them.
        """
        raw = np.rint(values / self.step)
        there = np.isfinite(raw)
        self.out_of_range += int(np.count_nonzero(there & ((raw < self.low) | (raw > self.high))))
        raw = np.where(there, np.clip(raw, self.low, self.high), self._none)
        numbers = raw.astype(np.int64).tolist()
        return [
            (identifier, self._data(identifier, numbers, others)) for identifier in self._messages
        ]

    def _data(self, identifier: int, numbers: Sequence[int], others: dict[str, int]) -> bytes:
        message = self._messages[identifier]
        raw: dict[str, int | float | str] = {n: numbers[i] for i, n in self.places[identifier]}
        raw |= {name: value for name, value in others.items() if name in message.signal_tree}
        return message.encode(raw, scaling=False, strict=False)

    def decode(self, identifier: int, data: bytes, values: Array) -> dict[str, int]:
        """Write the values of one frame to their places in `values`, SI units, NaN for no value;
        return the raw values of its other signals. Raises ValueError for data that are too short.
        """
        from cantools.database import DecodeError

        try:
            raw = self._messages[identifier].decode(data, decode_choices=False, scaling=False)
        except DecodeError as error:
            raise ValueError(str(error)) from None
        assert isinstance(raw, dict)
        numbers = {name: int(value) for name, value in raw.items()}  # type: ignore[arg-type]
        for i, name in self.places[identifier]:
            number = numbers.pop(name)
            values[i] = np.nan if number == self._none[i] else number * self.step[i]
        return numbers

    def quantised(self, values: Array) -> Array:
        """Return what is left of vectors (..., quantities) behind the bus, without the frames."""
        raw = np.clip(np.rint(values / self.step), self.low, self.high)
        return np.asarray(raw * self.step)


def _signal(messages: Sequence[Message], name: str) -> Signal:
    return next(s for message in messages for s in message.signals if s.name == name)


def _no_value(signal: Signal) -> int:
    return next(raw for raw, word in (signal.choices or {}).items() if str(word) == NO_VALUE)


def to_sensor() -> FrameSet:
    """Return the frames of what the sensor is given: 14 channels and 4 damper commands, (18,)."""
    return FrameSet(TO_SENSOR, GIVEN)


def from_sensor() -> FrameSet:
    """Return the frames of what it answers with: 4 velocities and their 4 deviations, (8,)."""
    return FrameSet(FROM_SENSOR, ANSWERED)


def encode_one(frame: Frame, **raw: int) -> Data:
    """Return a frame without quantities from its signals' raw values."""
    message = database().get_message_by_frame_id(frame.identifier)
    return frame.identifier, message.encode(dict(raw), scaling=False, strict=False)


def decode_one(frame: Frame, data: bytes) -> dict[str, int] | None:
    """Return the raw values of a frame without quantities, None if it has too few data."""
    from cantools.database import DecodeError

    message = database().get_message_by_frame_id(frame.identifier)
    try:
        raw = message.decode(data, decode_choices=False, scaling=False)
    except DecodeError:
        return None
    assert isinstance(raw, dict)
    return {name: int(value) for name, value in raw.items()}  # type: ignore[arg-type]


def answer_signals(counter: int, age_ms: float, valid: bool) -> dict[str, int]:
    """Return what is beside the values in the frames of an answer, raw."""
    age = min(round(age_ms / AGE.step), AGE.raw_range[1])
    return {COUNTER.name: counter, AGE_OF_ANSWER.name: age, VALID.name: int(valid)}


def age_ms(raw: int) -> float:
    """Return the age that an answer tells [ms]."""
    return raw * AGE.step
