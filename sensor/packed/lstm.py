"""The LSTM operator of an ONNX graph: both directions, or the forward one."""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sensor.channels import CHANNELS
from sensor.errors import SensorError
from sensor.packed.graph import attributes, described
from sensor.packed.onnx_file import Node
from sensor.packed.signal import Signal, Value
from sensor.packed.standardisation import take_standardisation

Array = npt.NDArray[Any]

_ACTIVATIONS: Final = ("Sigmoid", "Tanh", "Tanh")
_WEIGHTS_NDIM: Final = 3  # (directions, 4 units, inputs)
_DIRECTIONS: Final = {"forward": [0], "reverse": [1], "bidirectional": [0, 1]}
_KEEP: Final = [0, 3, 1]  # the backward cell: input, cell and output gate, nothing to forget


class Lstm:
    """Takes the LSTM's weights over into `arrays`, and gives its outputs numbers."""

    def __init__(self, window: int, arrays: dict[str, Array]) -> None:
        self._window, self._arrays = window, arrays

    def results(self, node: Node, values: list[Any]) -> list[Value]:
        """Return Y, Y_h and Y_c. Raises SensorError naming what is not supported."""
        x, w, r, b, lengths, *states = [*values, *[None] * 8][:8]
        directions = self._directions(node)
        if "forward_R" in self._arrays and 0 in directions:
            raise SensorError(f"{described(node)} is the second LSTM, where one is supported.")
        if lengths is not None:
            raise SensorError(f"{described(node)} with sequence lengths is not supported.")
        if any(s is not None and (isinstance(s, Signal) or np.any(s)) for s in states):
            raise SensorError(
                f"{described(node)} with an initial state or peepholes other than zero is not"
                " supported."
            )
        self._check_input(node, x)
        if not all(isinstance(part, np.ndarray) and part.ndim == _WEIGHTS_NDIM for part in (w, r)):
            raise SensorError(f"{described(node)} has no weights of three dimensions.")
        units = r.shape[2]
        for place, direction in enumerate(directions):
            self._take(
                direction, w[place], r[place], b[place] if b is not None else np.zeros(8 * units)
            )
        return self._outputs(directions, units)

    def _directions(self, node: Node) -> list[int]:
        given = attributes("LSTM", node.attributes)
        direction = given.pop("direction", "forward")
        if direction not in _DIRECTIONS:
            raise SensorError(f"{described(node)} with direction {direction!r} is not supported.")
        directions = _DIRECTIONS[direction]
        activations = tuple(given.pop("activations", ()))
        if activations not in ((), _ACTIVATIONS * len(directions)):
            raise SensorError(
                f"{described(node)} with activations {', '.join(activations)} is not supported."
            )
        if given:
            raise SensorError(f"{described(node)} with {next(iter(given))} is not supported.")
        return directions

    def _check_input(self, node: Node, x: Value | None) -> None:
        """Its input is the standardised window, (W, 1, 14)."""
        wanted = np.arange(self._window * len(CHANNELS)).reshape(self._window, 1, len(CHANNELS))
        if (
            not isinstance(x, Signal)
            or x.kind != "sample"
            or not np.array_equal(x.elements, wanted)
        ):
            raise SensorError(
                f"{described(node)} does not read the window sample by sample, which is all that is"
                " supported."
            )
        for scale, offset in zip(
            *(np.reshape(a, wanted.shape) for a in (x.scale, x.offset)), strict=True
        ):
            take_standardisation(self._arrays, scale[0], offset[0])

    def _take(self, direction: int, w: Array, r: Array, b: Array) -> None:
        units = r.shape[1]
        if w.shape != (4 * units, len(CHANNELS)) or r.shape != (4 * units, units):
            raise SensorError(
                f"the LSTM's weights have shapes {list(w.shape)} and {list(r.shape)}."
            )
        bias = (b[: 4 * units] + b[4 * units :]).astype(np.float32)
        if direction:
            self._arrays["backward_W"] = w.reshape(4, units, -1)[_KEEP].reshape(3 * units, -1)
            self._arrays["backward_B"] = bias.reshape(4, units)[_KEEP].ravel()
        else:
            self._arrays |= {"forward_W": w, "forward_R": r, "forward_B": bias}

    def _outputs(self, directions: list[int], units: int) -> list[Value]:
        t, d, u = np.arange(self._window), np.array(directions), np.arange(units)
        y = (2 * t[:, None, None, None] + d[None, :, None, None]) * units + u
        last = np.concatenate(
            [y[0 if direction else -1, i : i + 1] for i, direction in enumerate(directions)]
        )
        return [Signal.of("state", y), Signal.of("state", last), Signal.of("cell", last)]
