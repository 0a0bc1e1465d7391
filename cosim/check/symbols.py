"""Which functions a binary must export, and which capability needs each.

FMI 2.0.5, section 2.3: all functions of co-simulation are present, even those for capabilities that
the FMU lacks. FMI 3.0.1, section 2.1: all functions of the standard are.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Final

from cosim.check.description import Description
from cosim.check.schema import fmpy_folder

_STATE: Final = ("GetFMUState", "SetFMUState", "FreeFMUState")
_SERIALISED: Final = ("SerializedFMUStateSize", "SerializeFMUState", "DeserializeFMUState")
NEEDED_BY: Final = {
    **dict.fromkeys(_STATE, "canGetAndSetFMUState"),
    **dict.fromkeys(_SERIALISED, "canSerializeFMUState"),
    "GetDirectionalDerivative": "providesDirectionalDerivatives",
    "GetAdjointDerivative": "providesAdjointDerivatives",
    "SetRealInputDerivatives": "canInterpolateInputs",
    "GetRealOutputDerivatives": "maxOutputDerivativeOrder",
    "GetOutputDerivatives": "maxOutputDerivativeOrder",
    "CancelStep": "canRunAsynchronuously",
    "EnterEventMode": "hasEventMode",
    "EnterStepMode": "hasEventMode",
    "UpdateDiscreteStates": "hasEventMode",
    "GetNumberOfVariableDependencies": "providesPerElementDependencies",
    "GetVariableDependencies": "providesPerElementDependencies",
}
OTHER_INTERFACES: Final = {
    2: ("EnterEventMode", "NewDiscreteStates", "EnterContinuousTimeMode", "CompletedIntegratorStep",
        "SetTime", "SetContinuousStates", "GetDerivatives", "GetEventIndicators",
        "GetContinuousStates", "GetNominalsOfContinuousStates"),
    3: ("InstantiateModelExchange", "InstantiateScheduledExecution", "EnterContinuousTimeMode",
        "CompletedIntegratorStep", "SetTime", "SetContinuousStates",
        "GetContinuousStateDerivatives",
        "GetEventIndicators", "GetContinuousStates", "GetNominalsOfContinuousStates",
        "GetNumberOfEventIndicators", "GetNumberOfContinuousStates", "ActivateModelPartition"),
}  # fmt: skip


@cache
def standard_functions(major: int) -> tuple[str, ...]:
    """Return every function of the standard, from the headers that come with FMPy."""
    header = fmpy_folder() / "c-code" / f"fmi{major}Functions.h"
    pattern = rf"^#define\s+(fmi{major}\w+)\s+fmi{major}FullName\("
    return tuple(re.findall(pattern, header.read_text(encoding="utf-8"), re.M))


def required(major: int) -> tuple[str, ...]:
    """Return the functions without which no FMU for co-simulation is complete."""
    others = {f"fmi{major}{name}" for name in OTHER_INTERFACES[major]}
    return tuple(name for name in standard_functions(major) if name not in others)


def reason(function: str, description: Description) -> str:
    """Return why a function must be there: the declared capability, or the standard."""
    plain = re.sub(r"^fmi\d", "", function)
    plain = plain.replace("FMUstate", "FMUState").replace("DeSerialize", "Deserialize")
    capability = NEEDED_BY.get(plain)
    if capability and description.simulation is not None:
        name = description.flag_name(capability)
        value = description.simulation.get(name)
        if value not in (None, "false", "0"):
            return f'{name}="{value}" promises it'
    unused = ", even where the FMU does not use it" if capability else ""
    return f"FMI {description.version} wants it in every FMU for co-simulation{unused}"
