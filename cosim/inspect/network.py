"""What is inside an ONNX network: ports, operators, size, and what its metadata say."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cosim.errors import InputError
from cosim.inspect.facts import Facts, number, size_of
from sensor.channels import CHANNELS, OUTPUTS, SAMPLE_RATE_HZ, check_channels
from sensor.errors import SensorError
from sensor.packed.onnx_file import Model, OnnxError, Port, read_onnx

METADATA_KEY = "sensor"  # as sensor/runtime.py, which would load ONNX Runtime, has it


def inspect(path: Path) -> Facts:
    """Return the facts of an ONNX file. Raises `InputError` if it is none."""
    try:
        model = read_onnx(path.read_bytes())
    except OnnxError as error:
        raise InputError(f"{path}: {error}") from None
    metadata = _metadata(model)
    fits = _fits(metadata) or _shape(metadata, model)
    size = path.stat().st_size
    data = {
        "kind": "network",
        "file": str(path),
        "bytes": size,
        "ir_version": model.ir_version,
        "opsets": {name or "ai.onnx": version for name, version in model.opsets.items()},
        "producer": f"{model.producer} {model.producer_version}".strip(),
        "graph": model.graph,
        "description": model.description,
        "inputs": [_port(port) for port in model.inputs],
        "outputs": [_port(port) for port in model.outputs],
        "operators": dict(model.operators.most_common()),
        "parameters": model.parameters,
        "weights": {
            name: {"type": kind, "shape": list(shape)}
            for name, (kind, shape) in model.weights.items()
        },
        "metadata": {**model.metadata, **({METADATA_KEY: metadata} if metadata else {})},
        "fits_the_sensor": fits == "",
        "why_not": fits,
    }
    headline = f"{path}: ONNX network, {model.parameters} parameters, {size_of(size)}"
    facts = Facts(headline, data)
    _tables(facts, model, metadata)
    facts.notes.append(
        "it fits the virtual sensor: channels, units, rate and window are right"
        if not fits
        else f"it does not fit the virtual sensor: {fits}"
    )
    if model.external:
        facts.notes.append(f"{len(model.external)} of its weights lie in files beside it")
    return facts


def _port(port: Port) -> dict[str, Any]:
    return {"name": port.name, "type": port.type, "shape": list(port.shape)}


def _metadata(model: Model) -> dict[str, Any]:
    try:
        found = json.loads(model.metadata.get(METADATA_KEY, "{}"))
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _fits(metadata: Mapping[str, Any]) -> str:
    """Return why the network cannot take the sensor's place, '' if it can."""
    if not metadata:
        return f"its metadata have no entry '{METADATA_KEY}', so its channels are unknown"
    try:
        parts = ((metadata["inputs"], CHANNELS), (metadata["outputs"], OUTPUTS))
        for name, (part, expected) in zip(("inputs", "outputs"), parts, strict=True):
            check_channels(name, part["names"], part["units"], expected)
        rate = metadata["sample_rate_hz"]
    except SensorError as error:
        return str(error)
    except (KeyError, TypeError) as error:
        return f"its metadata lack or misspell {error}"
    return "" if rate == SAMPLE_RATE_HZ else f"{rate:g} Hz, where {SAMPLE_RATE_HZ} Hz belong"


def _shape(metadata: Mapping[str, Any], model: Model) -> str:
    if metadata.get("kind") == "carried":
        return _carried_state(model)
    wanted = [metadata.get("window"), len(CHANNELS)]
    shapes = [list(port.shape[1:]) for port in model.inputs]
    if shapes == [wanted]:
        return ""
    return f"its inputs are {shapes}, where one of {wanted} belongs behind the batch"


def _carried_state(model: Model) -> str:
    """Return what a network with carried state lacks: each state comes out as `next_...`."""
    inputs = {port.name: list(port.shape) for port in model.inputs}
    outputs = {port.name: list(port.shape) for port in model.outputs}
    if inputs.pop("measured", None) != [1, len(CHANNELS)] or "command" not in inputs:
        return f"it does not take one sample, measured 1 x {len(CHANNELS)}, and the damper command"
    del inputs["command"]
    lost = [name for name, shape in inputs.items() if outputs.get(f"next_{name}") != shape]
    return f"it does not return its state {', '.join(lost)}" if lost else ""


def _tables(facts: Facts, model: Model, metadata: Mapping[str, Any]) -> None:
    opsets = ", ".join(f"{n or 'ai.onnx'} {v}" for n, v in sorted(model.opsets.items()))
    window, rate = metadata.get("window"), metadata.get("sample_rate_hz")
    others = sorted(set(model.metadata) - {METADATA_KEY})
    facts.pairs(
        "Identity",
        [
            ("graph", model.graph),
            ("produced by", facts.data["producer"]),
            ("operator set", opsets),
            ("IR version", str(model.ir_version)),
            ("description", model.description),
            ("window", f"{window} samples" if window else ""),
            ("sample rate", f"{rate} Hz" if rate else ""),
            ("other metadata", ", ".join(others)),
        ],
    )
    ports = [
        (kind, p.name, p.type, " x ".join(map(str, p.shape)) or "scalar")
        for kind, group in (("input", model.inputs), ("output", model.outputs))
        for p in group
    ]
    facts.table("Inputs and outputs", ("", "name", "type", "shape"), ports)
    counts = [(name, str(count)) for name, count in model.operators.most_common()]
    facts.table("Operators", ("operator", "number"), counts)
    weights = [
        (name, kind, " x ".join(map(str, shape)) or "scalar")
        for name, (kind, shape) in model.weights.items()
    ]
    facts.table("Weights and constants", ("name", "type", "shape"), weights, 30)
    for kind in ("inputs", "outputs"):
        facts.table(
            f"Channels: {kind}", ("name", "unit", "mean", "deviation"),
            _channels(metadata.get(kind)),
        )  # fmt: skip
    facts.pairs("Training", _training(metadata.get("training")))


def _channels(part: Any) -> list[tuple[str, ...]]:
    if not isinstance(part, Mapping) or not isinstance(part.get("names"), list):
        return []
    columns = [part.get(key) or [] for key in ("names", "units", "mean", "std")]
    rows = []
    for i, name in enumerate(columns[0]):
        unit = columns[1][i] if i < len(columns[1]) else ""
        figures = [number(c[i], digits=4) if i < len(c) else "" for c in columns[2:]]
        rows.append((str(name), str(unit), *figures))
    return rows


def _training(training: Any) -> list[tuple[str, str]]:
    """The figures of a training record, whatever of them there is."""
    if not isinstance(training, Mapping):
        return []
    pairs = [
        (str(key).replace("_", " "), str(value))
        for key, value in training.items()
        if isinstance(value, str | int | float) and not isinstance(value, bool)
    ]
    epochs = training.get("epochs")
    if isinstance(epochs, list) and epochs and isinstance(epochs[-1], Mapping):
        pairs.append(("epochs", str(len(epochs))))
        pairs += [
            (f"last {str(key).replace('_', ' ')}", number(value))
            for key, value in epochs[-1].items()
            if key.endswith("rmse")
        ]
    recipe = training.get("recipe")
    if isinstance(recipe, Mapping):
        pairs += [(f"recipe {key}", str(recipe[key])) for key in ("name", "seed") if key in recipe]
    samples = training.get("samples")
    if isinstance(samples, Mapping):
        pairs += [
            (f"{part} samples", f"{sum(runs.values())} in {len(runs)} runs")
            for part, runs in samples.items()
            if isinstance(runs, Mapping)
        ]
    return pairs
