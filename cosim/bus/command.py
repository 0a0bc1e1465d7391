"""`cosim sensor-node`: an estimator in a process of its own."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from cosim.bus.fingerprint import fingerprint
from cosim.bus.node import Counts, Ending, SensorNode
from cosim.bus.transport import Address, Link, Option
from cosim.errors import InputError, NetworkError, Place, Problem, did_you_mean
from cosim.sensor_fmu import FmuSensor
from sensor.conditions import CONDITIONS
from sensor.errors import SensorError
from sensor.estimator import Estimator
from sensor.estimators import DEFAULT, make, model_file, names, open_network


@dataclass(frozen=True)
class Choice:
    """Which estimator the node runs: a name and a condition, or a network's or an FMU's file."""

    estimator: str | None
    network: Path | None
    fmu: Path | None
    condition: str

    def __str__(self) -> str:
        return str(self.network or self.fmu or f"{self.estimator} ({self.condition})")


def run(choice: Choice, address: Address, patience_ms: float, ending: Ending) -> dict[str, Any]:
    """Answer on the bus until the end; return the figures of what was done."""
    estimator, mark = _estimator(choice)
    with _freed(estimator), Link(address) as link, _stopping() as stopped:
        node = SensorNode(link, estimator, mark, 1e-3 * patience_ms)
        click.echo(f"{choice} on bus {address}; Ctrl-C ends it", err=True)
        try:
            node.run(ending, lambda: bool(stopped))
        except SensorError as error:
            raise NetworkError(str(error)) from error
    for line in _words(node.counts):
        click.echo(line, err=True)
    return node.counts.as_dict()


def choice_of(
    estimator: str | None, network: Path | None, fmu: Path | None, condition: str
) -> Choice:
    """Return the choice of the command line; raises `InputError` for one that is none."""
    given = [choice for choice in (estimator, network, fmu) if choice is not None]
    if len(given) > 1:
        raise InputError("give one of --estimator, --network and --fmu")
    name = None if network or fmu else estimator or DEFAULT
    if name is not None and name not in names():
        hint = did_you_mean(name, names()) or f"; there are {', '.join(names())}"
        raise InputError(f"there is no estimator '{name}'{hint}")
    for file in (network, fmu):
        if file is not None and not file.is_file():
            raise InputError(f"there is no file '{file}'")
    return Choice(name, network, fmu, condition)


def options_of(texts: Sequence[str]) -> dict[str, Option]:
    """Return the options that NAME=VALUE texts mean; raises `InputError` for each that is none."""
    wrong = [text for text in texts if not all(text.partition("="))]
    if wrong:
        advice = "write NAME=VALUE, such as --option bitrate=500000"
        raise InputError([Problem(advice, Place(f"--option {text}")) for text in wrong])
    return {name: _value(text) for name, _, text in (text.partition("=") for text in texts)}


def _value(text: str) -> Option:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _estimator(choice: Choice) -> tuple[Estimator, int]:
    condition = next(known for known in CONDITIONS if known == choice.condition)
    if choice.fmu is not None:
        return FmuSensor(choice.fmu), fingerprint(None, choice.fmu)
    try:
        if choice.network is not None:
            return open_network(choice.network), fingerprint(None, choice.network)
        name = str(choice.estimator)
        return make(name, condition), fingerprint(name, model_file(name, condition))
    except SensorError as error:
        raise NetworkError(str(error)) from None


@contextmanager
def _freed(estimator: Estimator) -> Iterator[None]:
    """Free the estimator at the end if it is an FMU."""
    try:
        yield
    finally:
        if isinstance(estimator, FmuSensor):
            estimator.close()


@contextmanager
def _stopping() -> Iterator[list[int]]:
    """Give a list that is empty until the process is asked to end."""
    asked: list[int] = []
    kinds = (signal.SIGINT, signal.SIGTERM)
    before = {kind: signal.signal(kind, lambda number, _: asked.append(number)) for kind in kinds}
    try:
        yield asked
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)


def _words(counts: Counts) -> Iterator[str]:
    figures = counts.as_dict()
    yield (
        f"{counts.runs} runs, {counts.samples} samples, {counts.estimates} valid estimates; "
        f"{counts.frames_lost} frames lost, {counts.incomplete_samples} samples incomplete"
    )
    if counts.samples:
        p50, p99, largest = (figures[f"age_{name}_ms"] for name in ("p50", "p99", "max"))
        yield (
            f"from a sample's first frame to its answer: median {p50:.2f} ms, "
            f"99 % within {p99:.2f} ms, at most {largest:.2f} ms"
        )
