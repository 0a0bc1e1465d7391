"""From a controller FMU's settings in a scenario to its block, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from cosim.controller_fmu import FmuController
from cosim.errors import InputError, Problem, did_you_mean
from cosim.fmi import Description
from cosim.parameters import Setting
from cosim.quantities import CONTROLLER_INPUTS, CONTROLLER_OUTPUTS, ESTIMATE
from cosim.scenario.controllers import ControllerFmu
from cosim.wiring import Interface, Wiring, mapped_wiring

if TYPE_CHECKING:
    from cosim.scenario.schema import Scenario
    from cosim.scenario.source import Key

_SHOWN: Final = 12  # names of an FMU's variables in a message
_OUTPUTS: Final = tuple(replace(q, required=False) for q in CONTROLLER_OUTPUTS)


def fmu_controller(scenario: Scenario, chosen: ControllerFmu) -> FmuController:
    """Return the block of a controller FMU, fresh and not connected yet. Raises `InputError` with
    everything that is wrong with its settings, `FmuError` where the file is no FMU.
    """
    description, wiring, problems = _looked_at(scenario, chosen)
    if problems:
        raise InputError(problems)
    on_truth = chosen.feedback == "truth"
    return FmuController(description, wiring, chosen.parameters, on_truth, chosen.initial_command)


def controller_problems(scenario: Scenario) -> list[Problem]:
    """Return what is wrong with the scenario's controller FMUs; raises `FmuError` for a file that
    is none.
    """
    chosen = (c for c in scenario.controllers if isinstance(c, ControllerFmu))
    return [problem for one in chosen for problem in _looked_at(scenario, one)[2]]


def _looked_at(
    scenario: Scenario, chosen: ControllerFmu
) -> tuple[Description, Wiring, list[Problem]]:
    """Return a controller's FMU, its wiring, and what is wrong with either or the parameters."""
    labels = [controller.label for controller in scenario.controllers]
    key: Key = ("controllers", labels.index(chosen.label)) if chosen.label in labels else ()
    description = Description(scenario.resolve(chosen.file))
    interface = Interface(key, _OUTPUTS, CONTROLLER_INPUTS)
    wiring, problems = mapped_wiring(description, chosen.variables, scenario.problem, interface)
    if not problems:
        sentences = (_missing_outputs(description, wiring), _missing_inputs(description, wiring))
        problems += [scenario.problem((*key, "file"), one) for one in sentences if one]
    written = {wire.variable for wire in wiring.inputs}
    setting = Setting(description, written, scenario.problem)
    for name, value in chosen.parameters.items():
        problem = setting.problem((*key, "parameters", name), name, value)
        problems += [] if problem is None else [problem]
    return description, wiring, problems


def _missing_outputs(description: Description, wiring: Wiring) -> str:
    """Say which commands an FMU does not give; nothing where it gives all."""
    wired = {wire.quantity.name for wire in wiring.outputs}
    missing = [q.name for q in _OUTPUTS if q.name not in wired]
    if not missing:
        return ""
    return (
        f"'{description.path.name}' has no output {_listed(missing, 'or')}: map them under "
        f"variables; {_those_of(description, 'output', missing[0])}"
    )


def _missing_inputs(description: Description, wiring: Wiring) -> str:
    """Say that an FMU takes no suspension velocity; nothing where it takes one."""
    names = [quantity.name for quantity in ESTIMATE]
    if any(wire.quantity.name in names for wire in wiring.inputs):
        return ""
    return (
        f"'{description.path.name}' takes no suspension velocity, {_listed(names, 'or')}: map "
        f"at least one under variables; {_those_of(description, 'input', names[0])}"
    )


def _those_of(description: Description, causality: str, wanted: str) -> str:
    """List an FMU's variables of one causality, and the one most like `wanted`."""
    names = [v.name for v in description.variables.values() if v.causality == causality]
    if not names:
        return f"it has no {causality}s at all"
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    shown = ", ".join(names[:_SHOWN])
    return f"its {causality}s are {shown}{more}{did_you_mean(wanted, names)}"


def _listed(names: Sequence[str], word: str) -> str:
    *others, last = names
    return f"{', '.join(others)} {word} {last}" if others else last
