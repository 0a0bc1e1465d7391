"""What a record holds: its groups, in the order of the loop."""

from __future__ import annotations

from cosim.quantities import CHANNEL_QUANTITIES, DAMPERS, DRIVER, RECORDED, TRUTH, Quantity
from cosim.recorder import Signal
from cosim.scenario.controllers import Controller
from cosim.scenario.schema import Scenario
from sensor import CHANNELS, OUTPUTS, Channel
from sensor.conditions import Condition


def record_groups_of(scenario: Scenario, controller: Controller) -> list[tuple[str, list[Signal]]]:
    """Return the groups of the record of a scenario's run with one of its controllers."""
    late = controller.latency_of_run(scenario.latency).damper_ms > 0
    return record_groups(scenario.sensor.condition, bool(scenario.acting_faults), late)


def record_groups(
    condition: Condition = "ideal", faults: bool = False, late_dampers: bool = False
) -> list[tuple[str, list[Signal]]]:
    """Return the groups of the record, in the order of the loop. The channels are those that the
    sensor gets; the ideal ones, those measured, and the commands that the dampers hold follow where
    they differ.
    """

    def signals(quantities: tuple[Quantity, ...]) -> list[Signal]:
        return [Signal(q.name, q.unit if q.unit != "1" else "", q.description) for q in quantities]

    def other(name: str, what: str, there: bool) -> list[Signal]:
        made = (Signal(f"{name}.{c.name}", c.unit, f"{c.description}, {what}") for c in CHANNELS)
        return list(made) if there else []

    held = [Signal(f"Held.{q.name}", "", f"{q.description}, as it arrives") for q in DAMPERS]
    return [
        ("channels", signals(CHANNEL_QUANTITIES)),
        ("estimate", [Signal(o.name, o.unit, o.description) for o in OUTPUTS]),
        ("deviation", [_deviation(o) for o in OUTPUTS]),
        ("valid", [Signal("VRel.Valid", "", "1 where the estimate is valid")]),
        ("truth", signals(TRUTH)),
        ("command", signals(DAMPERS)),
        ("driver", signals(DRIVER)),
        ("vehicle", signals(RECORDED)),
        ("ideal", other("Ideal", "exactly", condition != "ideal")),
        ("measured", other("Measured", "as the car measured it", faults)),
        ("held", held if late_dampers else []),
    ]


def _deviation(output: Channel) -> Signal:
    """Return the signal of an output's predicted standard deviation."""
    wheel = output.name.split(".")[1]
    about = (
        f"standard deviation of the error that the sensor expects {wheel}, NaN if it expects none"
    )
    return Signal(f"VRel.Deviation.{wheel}", output.unit, about)
