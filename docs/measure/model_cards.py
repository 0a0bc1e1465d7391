"""The model card of each shipped network, beside its file: what it is, how it was trained, what it
reaches, where it must not be trusted.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from cases import CASES, ROBUST
from evaluated import NAMES, SURFACES, Evaluated, Record
from markdown_tables import fill, millimetres, percent, table

from sensor.conditions import CONDITIONS
from sensor.errors import SensorError
from sensor.estimators import model_file
from sensor.metadata import METADATA_KEY
from sensor.paper import paper_rows

_FORMS = {
    True: (
        "Virtual sensor for the four suspension velocities [m/s], positive in extension, from the "
        "last {window} samples of 14 channels: one bidirectional LSTM layer of {units} units per "
        "direction, its output at the last sample, a dense layer of {hidden}, four outputs."
    ),
    False: (
        "Virtual sensor for the four suspension velocities [m/s], positive in extension, with a "
        "predicted standard deviation for each: an LSTM of {units} units that carries its state "
        "from sample to sample, between dense layers of {front} and {hidden} units."
    ),
}


def write_cards(evaluated: Evaluated) -> list[Path]:
    """Write the card of every network that was evaluated; return their files."""
    written = []
    for name in evaluated.estimators:
        for condition in CONDITIONS:
            try:
                network = model_file(name, condition)
            except SensorError:
                continue
            if network is None or network.suffix != ".onnx" or condition not in network.stem:
                continue
            card = network.with_suffix(".md")
            fill(card, card_values(network, name, condition, evaluated), "model-card.md")
            written.append(card)
    return written


def card_values(
    network: Path, name: str, condition: str, evaluated: Evaluated
) -> dict[str, object]:
    """Return what the card's template asks for."""
    metadata = metadata_of(network)
    training = metadata["training"]
    recipe = training["recipe"]
    introduction = _FORMS["window" in metadata].format(**recipe["network"])
    return {
        "name": network.stem,
        "introduction": f"{introduction} In tables it is called {NAMES[name]}.",
        "recipe": recipe["name"],
        "training": table(("", ""), _settings(training)),
        "data": table(("part", ""), _data(training["samples"])),
        "commit": evaluated.commit,
        "condition": condition,
        "cases": table(
            ("case", "truth rms", "reached"),
            (
                [case.label, *_cells(evaluated, evaluated.case(case), condition, name)]
                for case in (*CASES, *(robust for robust, _ in ROBUST))
            ),
        ),
        "rows": _rows(evaluated, name, condition),
    }


def metadata_of(network: Path) -> dict[str, Any]:
    """Return what a network's file says of itself."""
    import onnxruntime as ort

    session = ort.InferenceSession(str(network), providers=["CPUExecutionProvider"])
    found = json.loads(session.get_modelmeta().custom_metadata_map[METADATA_KEY])
    return dict(found)


def _settings(training: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yield everything that the recipe sets, what was reached, and with which versions."""
    recipe, epochs = training["recipe"], training["epochs"]
    for key in ("seed", "condition"):
        if key in recipe:
            yield [key, str(recipe[key])]
    for part in ("network", "training"):
        for key, value in recipe[part].items():
            yield [f"{part}: {key.replace('_', ' ')}", str(value)]
    yield ["epochs, best in validation", f"{len(epochs)}, {training['best_epoch']}"]
    for key, value in training.items():
        if key.startswith("best_") and key != "best_epoch":
            yield [key.replace("_", " "), f"{value:.5g}"]
    yield ["duration", f"{sum(epoch['seconds'] for epoch in epochs) / 60.0:.0f} min"]
    for package, version in sorted(training["versions"].items()):
        yield [package, str(version)]


def _data(samples: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yield each part of the data: its runs and samples at 100 Hz, as far as the record tells."""
    for part, content in samples.items():
        words = part.replace("_", " ")
        if isinstance(content, Mapping):
            yield [words, f"{len(content)} runs, {sum(content.values())} samples"]
        elif isinstance(content, list):
            yield [words, ", ".join(map(str, content))]
        else:
            yield [words, f"{content} samples"]


def _rows(evaluated: Evaluated, name: str, condition: str) -> str:
    heads = [
        head for words in SURFACES.values() for head in (f"{words}: truth rms", f"{words}: reached")
    ]
    lines = []
    for row in paper_rows():
        cells = [row.scenario]
        for surface in SURFACES:
            cells += _cells(evaluated, evaluated.runs_of(row, surface), condition, name)
        lines.append([*cells, f"{1e3 * row.rmse_overall:.1f}; {row.accuracy:.1f}"])
    return table(("row", *heads, "paper"), lines)


def _cells(evaluated: Evaluated, runs: list[Record], condition: str, name: str) -> tuple[str, str]:
    overall = evaluated.pooled(runs, condition, name)["overall"]
    shown = percent(overall["accuracy"], overall["accuracy_meaningful"])
    return millimetres(overall["truth_rms"]), f"{millimetres(overall['rmse'])}; {shown}"
