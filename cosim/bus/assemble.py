"""From the bus of a scenario to its sensor."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cosim.bus.transport import Address, interface_problem, missing_packages
from cosim.errors import Problem

if TYPE_CHECKING:
    from cosim.bus.sensor import BusSensor
    from cosim.scenario.bus import Bus
    from cosim.scenario.schema import Scenario
    from cosim.scenario.sensor import Sensor


def address_of(bus: Bus) -> Address:
    """Return the bus of a scenario."""
    return Address(bus.interface, bus.channel, bus.options)


def bus_sensor(sensor: Sensor, file: Path | None) -> BusSensor:
    """Return the sensor of a run over its bus; `file` is that of its estimator."""
    from cosim.bus.fingerprint import fingerprint
    from cosim.bus.process import NodeProcess
    from cosim.bus.sensor import BusSensor, Waiting

    bus = sensor.bus
    assert bus is not None
    process = NodeProcess(node_arguments(sensor, file)) if bus.start_node else None
    waiting = Waiting(1e-3 * bus.deadline_ms, bus.oldest_samples, bus.connect_s)
    return BusSensor(address_of(bus), waiting, fingerprint(sensor.estimator, file), process)


def node_arguments(sensor: Sensor, file: Path | None) -> list[str]:
    """Return the arguments of `cosim sensor-node` for a scenario's sensor."""
    bus = sensor.bus
    assert bus is not None
    arguments = ["--interface", bus.interface]
    if bus.channel is not None:
        arguments += ["--channel", str(bus.channel)]
    for name, value in bus.options.items():
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
    if bus.start_node and bus.interface == "virtual":
        sentence = (
            "the virtual interface stays within one process, where no sensor node can be started; "
            "take udp_multicast"
        )
        return [scenario.problem(("sensor", "bus", "interface"), sentence)]
    return []
