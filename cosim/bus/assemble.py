"""From the bus of a scenario to its sensor."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import TYPE_CHECKING, Final

from cosim.bus.transport import Address, interface_problem, missing_packages, option_problem
from cosim.errors import Problem

if TYPE_CHECKING:
    from cosim.bus.sensor import BusSensor
    from cosim.scenario.bus import Bus
    from cosim.scenario.schema import Scenario
    from cosim.scenario.sensor import Sensor

PATIENCE: Final = 0.5
"""Share of the deadline for which a run's own node waits for the frames of a sample: long enough to
wait for all of them, short enough to answer without one.
"""


def address_of(bus: Bus) -> Address:
    """Return the bus of a scenario; a run that starts its own sensor over UDP takes a port that
    nobody uses where none is given, so that runs at the same time do not meet.
    """
    options = dict(bus.options)
    if bus.is_private:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("", 0))
            options["port"] = probe.getsockname()[1]
    return Address(bus.interface, bus.channel, options)


def bus_sensor(sensor: Sensor, file: Path | None) -> BusSensor:
    """Return the sensor of a run over its bus; `file` is that of its estimator."""
    from cosim.bus.fingerprint import fingerprint
    from cosim.bus.process import NodeProcess
    from cosim.bus.sensor import BusSensor, Waiting

    bus = sensor.bus
    assert bus is not None
    address = address_of(bus)
    process = None
    if bus.start_node:
        patience = ["--patience", f"{PATIENCE * bus.deadline_ms:g}"] if bus.deadline_ms else []
        process = NodeProcess([*node_arguments(sensor, file, address), *patience])
    waiting = Waiting(1e-3 * bus.deadline_ms, bus.oldest_samples, bus.connect_s)
    return BusSensor(address, waiting, fingerprint(sensor.estimator, file), process)


def node_arguments(sensor: Sensor, file: Path | None, address: Address) -> list[str]:
    """Return the arguments of `cosim sensor-node` for a scenario's sensor."""
    arguments = ["--interface", address.interface]
    if address.channel is not None:
        arguments += ["--channel", str(address.channel)]
    for name, value in address.options.items():
        arguments += ["--option", f"{name}={value}"]
    for kind in ("network", "fmu"):
        if getattr(sensor, kind) is not None:
            return [*arguments, f"--{kind}", str(file)]
    return [*arguments, "--estimator", str(sensor.estimator), "--condition", sensor.condition]


def bus_problems(scenario: Scenario) -> list[Problem]:
    """Return what a scenario's bus lacks or cannot do."""
    bus = scenario.sensor.bus
    if bus is None:
        return []
    if (missing := missing_packages(bus.interface)) is not None:
        return [scenario.problem(("sensor", "bus"), missing)]
    if (wrong := interface_problem(bus.interface)) is not None:
        return [scenario.problem(("sensor", "bus", "interface"), wrong)]
    if (wrong := option_problem(bus.interface, bus.options)) is not None:
        return [scenario.problem(("sensor", "bus", "options"), wrong)]
    if bus.start_node and bus.interface == "virtual":
        sentence = (
            "the virtual interface stays within one process, where no sensor node can be started; "
            "take udp_multicast"
        )
        return [scenario.problem(("sensor", "bus", "interface"), sentence)]
    return []
