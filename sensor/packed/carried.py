"""The network with carried state in an ONNX graph."""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sensor.carried.features import DELAYED, INTEGRALS, LINE, MEANS, FeatureConfig
from sensor.carried.operations import feature_constants, operations
from sensor.channels import OUTPUTS
from sensor.errors import SensorError
from sensor.packed.graph import Graph
from sensor.packed.pattern import Pattern

Array = npt.NDArray[Any]

STATES: Final = ("samples", "energy", "means", "integrals", "line", "hidden", "cell")
_FREE: Final = {  # constants of the features that may have any value
    *("residual_least", "residual_most", "slip_least", "slip_most", "least_speed"),
    *("slowest_rates", "zeros_before", "typical", "least_energy", "moving_scales"),
    *("moving_least", "moving_most", "integral_keep", "sample_time", "wheelbase_samples"),
    *("leads", "age_least", "age_most", "speed_unit", "slowness_unit", "line_last"),
    *("wheel_y", "per_ax", "per_ay", "axle"),
}
_DRIVING, _MOVING = 13, MEANS + INTEGRALS + 2 * LINE


def arrays(graph: Graph) -> dict[str, Array]:
    """Return the network's constants by their names in `sensor.carried.operations`, the depth of
    the delay line as `depth`. Raises SensorError naming what is not of this structure.
    """
    _check_ports(graph)
    given = ("measured", "command", *STATES)
    pattern = Pattern(graph, operations(0), {name: name for name in given})
    for name in ("estimate", "deviation", *(f"next_{state}" for state in STATES)):
        pattern.match(name, name)
    found = pattern.constants
    for name, value in feature_constants(FeatureConfig()).items():
        if name not in _FREE and not np.array_equal(np.ravel(found[name]), np.ravel(value)):
            raise SensorError(
                f"constant {pattern.found[name]!r} is {_short(found[name])}, where {_short(value)}"
                " belongs."
            )
    depth = _depth(graph)
    result = {**found, "depth": np.array(depth)}
    _check_shapes(result)
    return result


def _depth(graph: Graph) -> int:
    """Return the samples in the delay line, (depth, signals)."""
    shape = next(port.shape for port in graph.inputs if port.name == "line")
    if not shape or not isinstance(shape[0], int):
        raise SensorError(f"its input 'line' is {list(shape)}, where [depth, signals] belongs.")
    return shape[0]


def _check_ports(graph: Graph) -> None:
    wanted = {"measured", "command", *STATES}
    missing = sorted(wanted - {port.name for port in graph.inputs})
    ends = {"estimate", "deviation", *(f"next_{state}" for state in STATES)}
    missing += sorted(ends - {port.name for port in graph.outputs})
    if missing:
        raise SensorError(f"the graph has no input or output {', '.join(missing)}.")


def _check_shapes(found: dict[str, Array]) -> None:
    """Raise SensorError naming the first constant whose shape does not fit the others."""
    leads, depth = found["leads"].size, int(found["depth"])
    count = _DRIVING + _MOVING + len(DELAYED) * leads
    front, units = found["front_W"].shape[0], found["lstm_R"].shape[-1]
    hidden, four = found["hidden_W"].shape[0], len(OUTPUTS)
    shapes = {
        "front_W": (front, count), "front_B": (front,), "straight_W": (four, count),
        "lstm_W": (1, 4 * units, front), "lstm_R": (1, 4 * units, units),
        "lstm_B": (1, 8 * units), "hidden_W": (hidden, units), "hidden_B": (hidden,),
        "output_W": (four, hidden), "output_B": (four,), "deviation_W": (four, hidden),
        "deviation_B": (four,), "deviation_scale": (four,), "mean": (count,), "std": (count,),
        "moving_scales": (count - _DRIVING,), "slowest_rates": (1, MEANS + 1),
        "zeros_before": (1, MEANS + 1), "typical": (INTEGRALS,), "integral_keep": (INTEGRALS,),
        "wheel_y": (four,), "per_ay": (four,), "axle": (four,),
    }  # fmt: skip
    for name, shape in shapes.items():
        if found[name].shape != shape:
            raise SensorError(
                f"constant {name!r} has shape {list(found[name].shape)}, where {list(shape)}"
                " belongs."
            )
    for name in _FREE - shapes.keys() - {"leads"}:
        if found[name].size != 1:
            raise SensorError(f"constant {name!r} is no single number.")
    if int(found["line_last"].item()) != depth - 1 or found["age_most"].item() > depth - 3:
        raise SensorError(f"its features reach beyond the {depth} samples of its delay line.")


def _short(value: Array) -> str:
    return np.array2string(np.asarray(value).ravel(), threshold=8, separator=", ")
