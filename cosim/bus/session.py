"""One run as bench and sensor agree on it: who is there, and what was lost."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final

from cosim.bus.codec import decode_one, encode_one
from cosim.bus.messages import CONTROL, END, START, STATUS
from cosim.errors import BusError

if TYPE_CHECKING:
    import can

    from cosim.bus.transport import Link

REPEAT_S: Final = 0.1  # between two calls for the sensor
SECOND_ANSWER_S: Final = 0.05  # time for a second sensor to betray itself
MOST_FRAMES: Final = 1000  # read at once, whatever else is on the bus

Other = Callable[["can.Message"], None]


class Session:
    """The bench's talk with the sensor beside the samples. `other` is given the frames that are
    none of it.
    """

    def __init__(self, link: Link, other: Other) -> None:
        self._link = link
        self._other = other
        self._number = 1 + secrets.randbelow(0xFFFF)

    def begin(self, patience_s: float, ended: Callable[[], str | None]) -> int:
        """Call until a sensor answers and return its fingerprint. `ended` returns last words of the
        sensor's process where that is known to have ended. Raises `BusError` where none answers in
        time, or two do.
        """
        end = time.perf_counter() + patience_s
        calls, status = 0, None
        while status is None:
            if (words := ended()) is not None:
                raise BusError(f"the sensor on bus {self._link.address} has ended: {words}")
            if calls and time.perf_counter() > end:
                raise BusError(
                    f"no sensor answers on bus {self._link.address} within {patience_s:g} s; "
                    "start it with cosim sensor-node"
                )
            self._call(START)
            calls += 1
            status = self._status(REPEAT_S)
        answers = 1
        while self._status(SECOND_ANSWER_S) is not None:
            answers += 1
        if answers > calls:
            raise BusError(f"more than one sensor answers on bus {self._link.address}")
        return status["Fingerprint"]

    def end(self, patience_s: float) -> int | None:
        """Tell the end of the run, until the sensor has worked off what it was sent; return how
        many frames it has lost if it says so.
        """
        end = time.perf_counter() + patience_s
        while time.perf_counter() < end:
            self._call(END)
            if (status := self._status(REPEAT_S)) is not None:
                return status["FramesLost"]
        return None

    def check_alone(self, message: can.Message) -> None:
        """Raise `BusError` for a frame of another bench."""
        if message.arbitration_id != CONTROL.identifier:
            return
        told = decode_one(CONTROL, bytes(message.data))
        if told is not None and told["Session"] != self._number:
            raise BusError(
                f"another bench works on bus {self._link.address}; give each its own channel"
            )

    def _call(self, command: int) -> None:
        self._link.send(encode_one(CONTROL, Session=self._number, Command=command))

    def _status(self, timeout_s: float) -> Mapping[str, int] | None:
        """Return the sensor's next status of this run, None if none comes in time."""
        end = time.perf_counter() + timeout_s
        for _ in range(MOST_FRAMES):
            message = self._link.receive(max(end - time.perf_counter(), 0.0))
            if message is None:
                return None
            if message.arbitration_id != STATUS.identifier:
                self._other(message)
                continue
            status = decode_one(STATUS, bytes(message.data))
            if status is not None and status["Session"] == self._number:
                return status
        return None
