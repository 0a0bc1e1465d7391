"""From a controller's settings in a scenario to its block."""

from __future__ import annotations

from cosim.control.damper_map import DamperMap
from cosim.control.fixed import FixedDampers
from cosim.control.skyhook import Skyhook
from cosim.loop import ControllerBlock
from cosim.scenario import controllers as settings
from sensor.channels import PASSIVE_COMMAND


def controller_of(chosen: settings.Controller, dampers: DamperMap) -> ControllerBlock:
    """Return the block of a controller, fresh; `dampers` is the map that its law knows."""
    if isinstance(chosen, settings.Passive):
        return FixedDampers(PASSIVE_COMMAND)
    if isinstance(chosen, settings.Fixed):
        return FixedDampers(chosen.command)
    return Skyhook(
        chosen.feedback == "truth", chosen.gain_ns_per_m, chosen.initial_command, dampers
    )
