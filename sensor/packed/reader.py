"""Read an ONNX file as one of this sensor's networks, whoever wrote it."""

from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNELS
from sensor.errors import SensorError
from sensor.metadata import METADATA_KEY, ModelInfo, read_metadata
from sensor.operation import DOUBLE
from sensor.packed import carried
from sensor.packed.graph import Graph, graph_of
from sensor.packed.network import PackedNetwork
from sensor.packed.onnx_file import OnnxError, read_onnx
from sensor.packed.pattern import Pattern
from sensor.packed.windowed import WindowedWalk
from sensor.residual_matrices import residual_constants, residual_operations

Array = npt.NDArray[Any]

_FEWEST: Final = 2  # samples in a window


def read_network(path: str | Path) -> PackedNetwork:
    """Read a network from an ONNX file.

    Supported are the structures that this project trains: a window on a bidirectional LSTM tapped
    at its last sample (or on its forward direction and one backward cell), two dense layers with
    ReLU between them, with or without wheel-speed residuals; and the network with carried state.
    Names and the way an exporter moves elements about do not matter.

    Raises SensorError if the file or its metadata cannot be read, or naming the first operator or
    shape that is another one.
    """
    path = Path(path)
    try:
        model = read_onnx(path.read_bytes())
    except OSError as error:
        raise SensorError(f"{path}: it cannot be read: {error.strerror}.") from error
    except OnnxError as error:
        raise SensorError(f"{path}: {error}.") from error
    info = read_metadata(model.metadata.get(METADATA_KEY), str(path))
    try:
        graph = graph_of(model)
        arrays = carried.arrays(graph) if info.kind == "carried" else _windowed(graph, info)
        _check_numbers(arrays)
    except SensorError as error:
        raise SensorError(f"{path}: {error}") from error
    return PackedNetwork(info.kind, info.window, arrays, info.metadata)


def _windowed(graph: Graph, info: ModelInfo) -> dict[str, Array]:
    _check_ports(graph, info.window)
    start = graph.inputs[0].name
    residuals: dict[str, Array] = {}
    skipped: set[str] = set()
    casts = [n for n in graph.nodes if n.kind == "Cast" and n.inputs == (start,)]
    if any(node.attributes.get("to") == DOUBLE for node in casts):
        start, residuals, skipped = _residuals(graph, start)
    walk = WindowedWalk(graph, start, info.window)
    walk.run(skipped)
    return {**walk.arrays, **residuals}


def _check_ports(graph: Graph, window: int) -> None:
    if len(graph.inputs) != 1 or len(graph.outputs) != 1:
        raise SensorError(
            f"the graph has {len(graph.inputs)} inputs and {len(graph.outputs)} outputs, where one"
            " of each belongs."
        )
    port = graph.inputs[0]
    batch, *shape = port.shape or (0,)
    if shape != [window, len(CHANNELS)] or (isinstance(batch, int) and batch != 1):
        raise SensorError(
            f"its input {port.name!r} is {list(port.shape)}, where [batch, {window},"
            f" {len(CHANNELS)}] belongs."
        )
    if port.type != "float32":
        raise SensorError(f"its input {port.name!r} is of type {port.type}, where float32 belongs.")
    if window < _FEWEST:
        raise SensorError(f"its window has {window} samples, where at least {_FEWEST} belong.")


def _residuals(graph: Graph, start: str) -> tuple[str, dict[str, Array], set[str]]:
    """Return the value behind the residuals' operations, their constants, and what they compute."""
    last = residual_operations()[-1]
    for node in graph.nodes:
        if node.kind != "Cast" or node.attributes.get("to") != last.attributes["to"]:
            continue
        pattern = Pattern(graph, residual_operations(), {"measured": start})
        pattern.match(last.outputs[0], node.outputs[0])
        found = pattern.constants
        for name, value in residual_constants().items():
            if found[name].shape != value.shape:
                raise SensorError(
                    f"constant {pattern.found[name]!r} has shape {list(found[name].shape)}, where"
                    f" {list(value.shape)} belongs."
                )
        return node.outputs[0], found, set(pattern.found.values()) - {start}
    raise SensorError("operator Cast to float64 stands where only wheel-speed residuals have one.")


def _check_numbers(arrays: dict[str, Array]) -> None:
    for name, array in arrays.items():
        if np.issubdtype(array.dtype, np.floating) and not np.all(np.isfinite(array)):
            raise SensorError(f"its weights {name!r} hold a NaN or infinity.")
