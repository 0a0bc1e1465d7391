"""A network as numbers, apart from any file format."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class PackedNetwork:
    """Kind, window [samples] (1 with carried state), arrays by name and metadata.

    A windowed network has `forward_W` (4 units, 14), `forward_R` (4 units, units), `forward_B`
    (4 units,), gates in the order of ONNX (input, output, forget, cell); `backward_W` (3 units,
    14), `backward_B` (3 units,), gates input, cell, output; `dense_W` (hidden, 2 units), the
    forward half first, `dense_B`; `output_W` (4, hidden), `output_B`; `input_mean`, `input_std`
    (14,), `output_mean`, `output_std` (4,); and with residuals the constants of
    `sensor.residual_matrices.residual_operations`.

    A network with carried state has the constants of `sensor.carried.operations`, by their names
    there.
    """

    kind: Literal["windowed", "carried"]
    window: int
    arrays: Mapping[str, Array]
    metadata: Mapping[str, Any]

    @property
    def units(self) -> int:
        """Units of the LSTM, of its forward direction in a windowed network."""
        name = "forward_R" if self.kind == "windowed" else "lstm_R"
        return int(self.arrays[name].shape[-1])

    @property
    def hidden(self) -> int:
        """Units of the dense layer behind the LSTM."""
        return int(self.arrays["output_W"].shape[1])

    @property
    def residual(self) -> bool:
        """Whether a windowed network sees the wheel speeds as residuals."""
        return "wheels" in self.arrays

    @property
    def front(self) -> int:
        """Units of the dense layer before the LSTM; 0 in a windowed network."""
        return int(self.arrays["front_W"].shape[0]) if "front_W" in self.arrays else 0

    @property
    def leads(self) -> int:
        """Number of moments at which the delay line is read; 0 in a windowed network."""
        return int(np.size(self.arrays["leads"])) if "leads" in self.arrays else 0
