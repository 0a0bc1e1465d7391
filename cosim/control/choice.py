"""From a controller's settings in a scenario to its block."""

from __future__ import annotations

from cosim.control.add import Add, SkyhookAdd
from cosim.control.body import Body
from cosim.control.cautious import CautiousSkyhook
from cosim.control.damper_map import DamperMap
from cosim.control.fallback import Fallback, FallbackParameters
from cosim.control.fixed import FixedDampers
from cosim.control.hybrid import Hybrid
from cosim.control.law import Law, LawController
from cosim.control.modal import ModalGains, ModalSkyhook
from cosim.control.skyhook import Skyhook, TwoStateSkyhook
from cosim.loop import ControllerBlock
from cosim.scenario import controllers as settings
from sensor.channels import PASSIVE_COMMAND


def controller_of(
    chosen: settings.Controller, dampers: DamperMap, fmu: ControllerBlock | None = None
) -> ControllerBlock:
    """Return the block of a controller, fresh; `dampers` is the map that its law knows, `fmu` what
    stands in a law's place where the controller is an FMU.
    """
    if isinstance(chosen, settings.Passive):
        return FixedDampers(PASSIVE_COMMAND)
    if isinstance(chosen, settings.Fixed):
        return FixedDampers(chosen.command)
    controller = _fmu(fmu) if isinstance(chosen, settings.ControllerFmu) else _own(chosen, dampers)
    safe = chosen.fallback
    if safe is None:
        return controller
    parameters = FallbackParameters(
        safe.command, safe.largest_deviation_m_s, safe.fade_s, safe.back_after_s
    )
    return Fallback(controller, parameters)


def _fmu(block: ControllerBlock | None) -> ControllerBlock:
    if block is None:
        raise ValueError("a controller of kind fmu comes with its block")
    return block


def _own(chosen: settings.LawSettings, dampers: DamperMap) -> LawController:
    body = Body()
    law = _law(chosen, dampers, body)
    return LawController(law, chosen.feedback == "truth", chosen.initial_command, body)


def _law(chosen: settings.LawSettings, dampers: DamperMap, body: Body) -> Law:
    match chosen:
        case settings.Skyhook():
            return Skyhook(dampers, chosen.gain_ns_per_m)
        case settings.CautiousSkyhook():
            return CautiousSkyhook(dampers, chosen.gain_ns_per_m, chosen.least_deviation_m_s)
        case settings.TwoStateSkyhook():
            return TwoStateSkyhook(chosen.hard_command)
        case settings.Add():
            return Add(chosen.hard_command)
        case settings.SkyhookAdd():
            return SkyhookAdd(chosen.hard_command, chosen.crossover_hz)
        case settings.Hybrid():
            return Hybrid(dampers, chosen.gain_ns_per_m, chosen.skyhook_share)
        case settings.ModalSkyhook():
            gains = ModalGains(
                chosen.heave_ns_per_m, chosen.roll_nms_per_rad, chosen.pitch_nms_per_rad
            )
            return ModalSkyhook(dampers, body.mixing, gains)
