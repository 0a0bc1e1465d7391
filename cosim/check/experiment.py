"""The default experiment, the capabilities and the log categories of a model description."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator

from cosim.check.archive import MODEL_DESCRIPTION
from cosim.check.description import Description
from cosim.check.finding import Finding


def experiment_findings(description: Description) -> Iterator[Finding]:
    """Yield what is wrong with start, stop and step of the default experiment."""
    if description.experiment is None:
        return
    where = f"{MODEL_DESCRIPTION}:{description.experiment.sourceline}"
    values = {
        name: description.default(name)
        for name in ("startTime", "stopTime", "stepSize", "tolerance")
    }
    for name, value in values.items():
        if value is not None and not math.isfinite(value):
            yield Finding("not-finite", where, f"DefaultExperiment: {name} is {value}")
            return
    start, stop, step = values["startTime"] or 0.0, values["stopTime"], values["stepSize"]
    if stop is not None and stop < start:
        yield Finding(
            "stop-before-start", where,
            f"DefaultExperiment: stopTime {stop:g} s is before startTime {start:g} s",
        )  # fmt: skip
    if step is not None and step <= 0:
        yield Finding(
            "step-not-positive", where,
            f"DefaultExperiment: stepSize is {step:g} s; it must be positive",
        )  # fmt: skip
    elif step is not None and stop is not None and start <= stop < start + step:
        yield Finding(
            "step-beyond-stop", where,
            f"DefaultExperiment: one step of {step:g} s is longer than the experiment, "
            f"{start:g} to {stop:g} s",
        )  # fmt: skip
    if values["tolerance"] is not None and values["tolerance"] <= 0:
        yield Finding(
            "tolerance-not-positive", where,
            f"DefaultExperiment: tolerance is {values['tolerance']:g}; it must be positive",
        )  # fmt: skip


def interface_findings(description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the interface element, its flags, and the log categories."""
    root = description.root
    if description.simulation is None:
        kinds = [k for k in ("ModelExchange", "ScheduledExecution") if root.find(k) is not None]
        offers = f"it offers {' and '.join(kinds)} alone" if kinds else "it names no interface"
        yield Finding(
            "not-co-simulation", f"{MODEL_DESCRIPTION}:{root.sourceline}",
            f"the FMU is not for co-simulation: {offers}; export it for co-simulation",
        )  # fmt: skip
        return
    where = f"{MODEL_DESCRIPTION}:{description.simulation.sourceline}"
    if not re.fullmatch(r"[A-Za-z_]\w*", description.identifier, re.ASCII):
        yield Finding(
            "model-identifier", where,
            f"modelIdentifier '{description.identifier}' is no C identifier (letters, digits and "
            "underscores, no digit first); files and functions are named by it",
        )  # fmt: skip
    state, bytes_ = "canGetAndSetFMUState", "canSerializeFMUState"
    if description.flag(bytes_) and not description.flag(state):
        yield Finding(
            "capability-contradiction", where,
            f"{description.flag_name(bytes_)} is true, but {description.flag_name(state)} is not; "
            "a state that cannot be got cannot be serialised",
        )  # fmt: skip
    for name, count in Counter(description.categories).items():
        if count > 1:
            yield Finding(
                "duplicate-category", MODEL_DESCRIPTION,
                f"the log category '{name}' is declared {count} times",
            )  # fmt: skip
    if not description.token:
        token = "guid" if description.major == 2 else "instantiationToken"
        yield Finding(
            "token-empty", f"{MODEL_DESCRIPTION}:{root.sourceline}",
            f"{token} is empty; XML and binary cannot be told to belong together",
        )  # fmt: skip
