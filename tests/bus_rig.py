"""What tests of the bus share: nodes in threads, and a gateway that loses frames."""

from __future__ import annotations

import socket
import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import numpy.typing as npt

from cosim.bus.node import Ending, SensorNode
from cosim.bus.sensor import BusSensor, Waiting
from cosim.bus.transport import Address, Link

Array = npt.NDArray[np.float64]

WAITING = Waiting(deadline_s=5.0, oldest_samples=0, connect_s=5.0)


def virtual() -> Address:
    """A virtual bus of its own."""
    return Address("virtual", f"test-{uuid.uuid4()}")


def free_udp() -> Address:
    """A multicast bus on a port that nobody uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = probe.getsockname()[1]
    return Address("udp_multicast", "239.74.163.2", {"port": port})


class Echo:
    """An estimator whose estimate is a hundredth of az, plus the command, at each wheel."""

    def __init__(self, warm_up: int = 3, work: Callable[[int], None] | None = None) -> None:
        self.estimate: Array = np.full(4, np.nan)
        self.deviation: Array = np.full(4, np.nan)
        self.steps = 0
        self._warm_up = warm_up
        self._work = work

    def reset(self) -> None:
        self.steps = 0

    def step(self, measured: Array, command: Array) -> bool:
        self.steps += 1
        if self._work is not None:
            self._work(self.steps)
        if self.steps <= self._warm_up:
            return False
        self.estimate[:] = 0.01 * measured[2] + command
        self.deviation[:] = 0.01
        return True

    def apply(self, channels: Array, commands: Array) -> Array:
        raise NotImplementedError


@contextmanager
def node(
    address: Address, estimator: Echo, fingerprint: int = 0, patience_s: float = 0.05
) -> Iterator[SensorNode]:
    """A sensor node in a thread."""
    stop = threading.Event()
    with Link(address) as link:
        made = SensorNode(link, estimator, fingerprint, patience_s)
        thread = threading.Thread(target=made.run, args=(Ending(), stop.is_set), daemon=True)
        thread.start()
        try:
            yield made
        finally:
            stop.set()
            thread.join(timeout=10.0)
            assert not thread.is_alive()


@contextmanager
def bench(
    address: Address, waiting: Waiting = WAITING, fingerprint: int = 0
) -> Iterator[BusSensor]:
    """The bench's end, open."""
    sensor = BusSensor(address, waiting, fingerprint)
    sensor.open()
    try:
        yield sensor
    finally:
        sensor.close()


@contextmanager
def gateway(one: Address, other: Address, passes: Callable[[int, int], bool]) -> Iterator[None]:
    """Carry frames between two buses, those for which `passes(identifier, nth of it)` says so."""
    stop = threading.Event()
    links = Link(one), Link(other)
    seen: dict[int, int] = {}

    def carry(source: Link, target: Link) -> None:
        while not stop.is_set():
            message = source.receive(0.02)
            if message is None:
                continue
            identifier = message.arbitration_id
            seen[identifier] = seen.get(identifier, -1) + 1
            if passes(identifier, seen[identifier]):
                target.send((identifier, bytes(message.data)))

    threads = [
        threading.Thread(target=carry, args=pair, daemon=True) for pair in (links, links[::-1])
    ]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        stop.set()
        for thread in threads:
            thread.join(timeout=10.0)
        for link in links:
            link.close()
