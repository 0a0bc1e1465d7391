"""Does a graph do certain operations? Compared from the result backwards: there every value has one
producer, so that names and order do not matter.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.errors import SensorError
from sensor.operation import NONE, Operation
from sensor.packed.graph import Graph, attributes, described

Array = npt.NDArray[Any]


class Pattern:
    """Operations to be found in a graph, and what of the graph stands for what of them: `found`
    maps their names to the graph's.
    """

    def __init__(
        self, graph: Graph, operations: Iterable[Operation], inputs: Mapping[str, str]
    ) -> None:
        """`inputs` are the values from which the operations start, their names and the graph's."""
        self._graph = graph
        self._makers = {name: o for o in operations for name in o.outputs if name}
        self.found = dict(inputs)
        self.constants: dict[str, Array] = {}

    def match(self, wanted: str, given: str) -> None:
        """Find the operations that end in `wanted` behind the graph's value `given`.

        Raises SensorError naming the first operator that is another one.
        """
        open_ends = [(wanted, given)]
        while open_ends:
            name, value = open_ends.pop()
            if self._known(name, value):
                continue
            self.found[name] = value
            maker = self._makers.get(name)
            if maker is None:
                self._take_constant(name, value)
            else:
                open_ends += self._inputs(name, maker, value)

    def _known(self, name: str, value: str) -> bool:
        if name not in self.found:
            return False
        if self.found[name] != value and not self._same_constants(name, value):
            raise SensorError(
                f"value {value!r} stands where {self.found[name]!r} belongs ({name!r} of this"
                " sensor's networks)."
            )
        return True

    def _same_constants(self, name: str, value: str) -> bool:
        """Whether two constants differ by their names only, as exporters repeat them."""
        other = self._graph.constants.get(value)
        return (
            name in self.constants
            and other is not None
            and np.array_equal(self.constants[name], other)
        )

    def _take_constant(self, name: str, value: str) -> None:
        if value not in self._graph.constants:
            raise SensorError(f"value {value!r} is computed, where the constant {name!r} belongs.")
        self.constants[name] = self._graph.constants[value]

    def _inputs(self, name: str, maker: Operation, value: str) -> list[tuple[str, str]]:
        """Return the inputs of the operation and of its counterpart, in pairs."""
        node = self._graph.producers.get(value)
        if node is None:
            raise SensorError(f"value {value!r} stands where operator {maker.kind} belongs.")
        place = maker.outputs.index(name)
        if (
            node.kind != maker.kind
            or attributes(node.kind, node.attributes) != attributes(maker.kind, maker.attributes)
            or place >= len(node.outputs)
            or node.outputs[place] != value
        ):
            raise SensorError(
                f"{described(node)} with {attributes(node.kind, node.attributes)} is not supported:"
                f" {maker.kind} with {attributes(maker.kind, maker.attributes)} belongs there"
                f" ({name!r} of this sensor's networks)."
            )
        wanted, given = (list(inputs) for inputs in (maker.inputs, node.inputs))
        given += [NONE] * (len(wanted) - len(given))
        if len(given) > len(wanted) or any(
            (a == NONE) != (b == NONE) for a, b in zip(wanted, given, strict=False)
        ):
            raise SensorError(
                f"{described(node)} has other inputs than this sensor's networks have there."
            )
        return [(a, b) for a, b in zip(wanted, given, strict=True) if a != NONE]
