"""Events of the Open Simulation Platform's scenario format: override, bias and reset of variables.

The format is libcosim's, JSON or YAML (open-simulation-platform.github.io/libcosim/scenario). What
the page leaves open is as libcosim does it: a variable has one modification at a time, an event
takes the place of the one before; everything is taken back at `end`, and without an end, or with
one before the last event, at the step after that.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from pydantic import ConfigDict, Field, ValidationError

from cosim.errors import InputError, Problem, did_you_mean
from cosim.scenario.faults import SAMPLE_S, Bias, Fault, OspScenario, PlainFault, Stuck, labels
from cosim.scenario.messages import problems_of
from cosim.scenario.model import Model, with_unit
from cosim.scenario.source import Source, read
from cosim.scenario.vehicle import Variable
from sensor.channels import CHANNEL_NAMES

_NEEDS: Final = "a scenario of the Open Simulation Platform has events"
Action = Literal["override", "bias", "reset"]


class Defaults(Model):
    """What an event is about that does not say so itself."""

    model: str | None = None
    variable: str | None = None
    action: Action | None = None


class Event(Model):
    """From `time` on a variable has a value, an offset, or neither any more."""

    time: float = Field(ge=0, json_schema_extra=with_unit("s"))
    model: str | None = None
    variable: str | None = None
    action: Action | None = None
    value: float | None = None


class Events(Model):
    """The whole file."""

    model_config = ConfigDict(title="File of events")

    description: str = ""
    defaults: Defaults = Defaults()
    events: tuple[Event, ...] = Field(strict=False, min_length=1)
    end: float | None = Field(default=None, ge=0, json_schema_extra=with_unit("s"))

    def filled(self, event: Event) -> Event:
        """Return an event with the defaults for what it leaves out."""
        given = event.model_dump(exclude_none=True)
        return Event(**{**self.defaults.model_dump(exclude_none=True), **given})


@dataclass(frozen=True)
class Acting:
    """An entry of the scenario's list of faults as what it comes to, one after the other."""

    label: str
    faults: tuple[PlainFault, ...]


def acting(faults: Sequence[Fault], source: Source) -> tuple[tuple[Acting, ...], list[Problem]]:
    """Return what a scenario's faults come to, its files read, and all that is wrong with these."""
    found: list[Acting] = []
    problems: list[Problem] = []
    for place, (label, fault) in enumerate(zip(labels(faults), faults, strict=True)):
        if not isinstance(fault, OspScenario):
            found.append(Acting(label, (fault,)))
            continue
        try:
            events, file = _read(source.folder / fault.file)
            found.append(Acting(label, tuple(_faults(fault, events, file))))
        except InputError as error:
            at = source.locate(("faults", place, "file"))
            problems += [p if p.place else Problem(p.message, at) for p in error.problems]
    return tuple(found), problems


def _read(path: Path) -> tuple[Events, Source]:
    if path.suffix.lower() not in (".json", ".yaml", ".yml"):
        raise InputError(f"an OSP scenario is a .json, .yaml or .yml file, not '{path}'")
    data, source, problems = read(path, _NEEDS, "OSP scenario")
    try:
        events = Events.model_validate(data)
    except ValidationError as error:
        problems += problems_of(error, data, source, Events.model_json_schema())
    if problems:
        raise InputError(problems)
    return events, source


def _faults(fault: OspScenario, events: Events, file: Source) -> Iterator[PlainFault]:
    """Yield the events as faults of our channels; raises `InputError` with all that is wrong."""
    filled = [events.filled(event) for event in events.events]
    problems = [
        Problem(sentence, file.locate(("events", place)))
        for place, event in enumerate(filled)
        if (sentence := _lacking(event))
    ]
    if problems:
        raise InputError(problems)
    ours = _of_model(fault, filled)
    channels = _channels(fault.variables)
    for place in ours:
        variable = str(filled[place].variable)
        if variable not in channels:
            sentence = (
                f"no channel stands for the variable '{variable}'; name one under variables of the "
                f"fault{did_you_mean(variable, channels)}"
            )
            problems.append(Problem(sentence, file.locate(("events", place))))
    problems += _at_once(ours, filled, file)
    if problems:
        raise InputError(problems)
    end = _end(events)
    for channel, scale, its in _by_channel(ours, filled, channels):
        yield from _timed(channel, scale, its, end)


def _lacking(event: Event) -> str:
    """Return what an event does not say, and no default either."""
    for name in ("model", "variable", "action"):
        if getattr(event, name) is None:
            return f"the event has no {name}, and there is none under defaults"
    if event.action != "reset" and event.value is None:
        return f"the event has no value, which {event.action} needs"
    return ""


def _of_model(fault: OspScenario, events: Sequence[Event]) -> list[int]:
    """Return the places of the events of the model that stands for our vehicle."""
    models = sorted({str(event.model) for event in events})
    if fault.model is None:
        if len(models) > 1:
            raise InputError(
                f"the events are of the models {', '.join(models)}: say which of them is the "
                "vehicle, by model"
            )
        return list(range(len(events)))
    if fault.model not in models:
        hint = did_you_mean(fault.model, models) or f", but of {', '.join(models)}"
        raise InputError(f"no event is of the model '{fault.model}'{hint}")
    return [place for place, event in enumerate(events) if event.model == fault.model]


def _channels(variables: Mapping[str, Variable]) -> dict[str, tuple[str, float]]:
    """Return channel and factor to its SI unit by the name of the variable in the file."""
    own = {name: (name, 1.0) for name in CHANNEL_NAMES}
    return own | {v.name: (channel, v.scale) for channel, v in variables.items()}


def _at_once(ours: Sequence[int], events: Sequence[Event], file: Source) -> Iterator[Problem]:
    """Yield the events whose order nobody knows."""
    seen: set[tuple[str | None, float]] = set()
    for place in ours:
        key = events[place].variable, events[place].time
        if key in seen:
            sentence = f"a second event of {key[0]} at {key[1]:g} s: which of them comes first?"
            yield Problem(sentence, file.locate(("events", place)))
        seen.add(key)


def _end(events: Events) -> float:
    last = max(event.time for event in events.events)
    after = (math.ceil(last / SAMPLE_S - 1e-6) + 1) * SAMPLE_S
    return max(events.end or 0.0, after)


def _by_channel(
    ours: Sequence[int], events: Sequence[Event], channels: Mapping[str, tuple[str, float]]
) -> Iterator[tuple[str, float, list[Event]]]:
    for variable in dict.fromkeys(str(events[place].variable) for place in ours):
        its = [events[place] for place in ours if events[place].variable == variable]
        yield *channels[variable], sorted(its, key=lambda event: event.time)


def _timed(channel: str, scale: float, events: Sequence[Event], end: float) -> Iterator[PlainFault]:
    """Yield the faults of one channel, each until the next event."""
    ends = [*(event.time for event in events[1:]), end]
    for event, until in zip(events, ends, strict=True):
        if event.value is None or event.action == "reset":
            continue
        value, channels, start = scale * event.value, (channel,), event.time
        if event.action == "bias":
            yield Bias(kind="bias", value=value, channels=channels, start_s=start, end_s=until)
        else:
            yield Stuck(kind="stuck", value=value, channels=channels, start_s=start, end_s=until)
