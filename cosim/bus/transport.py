"""Frames over python-can, which knows the interfaces; it is loaded when a bus is opened."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import TracebackType
from typing import TYPE_CHECKING, Final, TypeAlias

from cosim.bus.codec import Data
from cosim.errors import BusError, InputError, did_you_mean

if TYPE_CHECKING:
    import can

Option: TypeAlias = str | int | float | bool

UDP_CHANNEL: Final = "239.74.163.2"  # python-can's own IPv4 group; its default needs IPv6
LAST_PORT: Final = 65535
SEND_TIMEOUT_S: Final = 1.0
WHEN_OPENED: Final = (ImportError, ValueError, TypeError, AttributeError, NotImplementedError)
"""What drivers also raise for a missing library or an option that they do not have."""


@dataclass(frozen=True)
class Address:
    """Which bus: python-can's interface and channel, and further options of the interface."""

    interface: str
    channel: str | int | None = None
    options: Mapping[str, Option] = field(default_factory=dict)

    def __str__(self) -> str:
        options = (f"{name}={value}" for name, value in self.options.items())
        parts = (self.interface, "" if self.channel is None else str(self.channel), *options)
        return " ".join(part for part in parts if part)


def missing_packages(interface: str) -> str | None:
    """Return what to install where a bus needs what is not there, else None."""
    names = {"can": "python-can", "cantools": "cantools"}
    if interface == "udp_multicast":
        names["msgpack"] = "msgpack"
    missing = [name for module, name in names.items() if not importlib.util.find_spec(module)]
    if not missing:
        return None
    return f"a sensor on a bus needs {' and '.join(missing)}; pip install 'suspension-cosim[can]'"


def interface_problem(interface: str) -> str | None:
    """Return what is wrong with the name of an interface, or None."""
    import can

    if interface in can.VALID_INTERFACES:
        return None
    known = ", ".join(sorted(can.VALID_INTERFACES))
    hint = did_you_mean(interface, can.VALID_INTERFACES) or f", which has {known}"
    return f"'{interface}' is not an interface of python-can{hint}"


def option_problem(interface: str, options: Mapping[str, Option]) -> str | None:
    """Return what is wrong with an option's name or with a port, or None; only for interfaces of
    python-can that would take any name without a word.
    """
    if interface not in ("socketcan", "udp_multicast", "virtual"):
        return None
    from can import BusABC
    from can.interfaces import BACKENDS

    module, kind = BACKENDS[interface]
    made = getattr(importlib.import_module(module), kind)
    both = (inspect.signature(one.__init__).parameters.values() for one in (made, BusABC))
    names = [p.name for its in both for p in its if p.kind != p.VAR_KEYWORD]
    # A bus that is no wire, or is set up by the system, is told its bit rate all the same.
    known = sorted({*names, "bitrate"} - {"self", "channel"})
    for name in options:
        if name not in known:
            hint = did_you_mean(name, known) or f", which has {', '.join(known)}"
            return f"'{name}' is not an option of {interface}{hint}"
    port = options.get("port", 1)
    if not isinstance(port, int) or not 0 < port <= LAST_PORT:
        return f"port must be a whole number from 1 to {LAST_PORT}, not {port!r}"
    return None


class Link:
    """One end of a bus; classic data frames with 11-bit identifiers only.

    Raises `InputError` where the packages or the interface are missing, `BusError` where the bus
    cannot be opened or fails.
    """

    def __init__(self, address: Address) -> None:
        problem = (
            missing_packages(address.interface)
            or interface_problem(address.interface)
            or option_problem(address.interface, address.options)
        )
        if problem:
            raise InputError(problem)
        import can

        self.address = address
        self._message = can.Message
        self._error: type[Exception] = can.CanError
        channel = address.channel
        if channel is None and address.interface == "udp_multicast":
            channel = UDP_CHANNEL
        options = {"ignore_config": True, **address.options}
        with self._failures("cannot open", *WHEN_OPENED):
            self._bus = can.Bus(channel, address.interface, **options)  # type: ignore[arg-type]

    def send(self, frame: Data) -> None:
        """Send one frame."""
        identifier, data = frame
        message = self._message(arbitration_id=identifier, data=data, is_extended_id=False)
        with self._failures("cannot send on"):
            self._bus.send(message, timeout=SEND_TIMEOUT_S)

    def receive(self, timeout_s: float) -> can.Message | None:
        """Return the next frame, or None if none came in `timeout_s`."""
        end = time.perf_counter() + timeout_s
        with self._failures("cannot receive from"):
            while True:
                message = self._bus.recv(max(end - time.perf_counter(), 0.0))
                if message is None or not _another_sort(message):
                    return message

    def close(self) -> None:
        """Leave the bus."""
        self._bus.shutdown()

    def __enter__(self) -> Link:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    @contextmanager
    def _failures(self, what: str, *others: type[Exception]) -> Iterator[None]:
        """Turn what drivers raise into one of this package's errors."""
        kinds: tuple[type[Exception], ...] = (self._error, OSError, *others)
        try:
            yield
        except kinds as error:
            cause = error.__cause__ or error
            reason = getattr(cause, "strerror", None) or str(cause) or type(cause).__name__
            raise BusError(f"{what} bus {self.address}: {reason}") from error


def _another_sort(message: can.Message) -> bool:
    """Whether a message is none of this bus's frames: error, remote, CAN FD or 29-bit."""
    other = message.is_error_frame or message.is_remote_frame or message.is_fd
    return other or message.is_extended_id
