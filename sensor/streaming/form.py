"""The streaming form at run time: its state in buffers that take turns, nothing copied."""

from typing import Any

import numpy as np
import numpy.typing as npt
import onnxruntime as ort

from sensor.channels import CHANNELS, OUTPUTS

Array = npt.NDArray[np.float64]
Float32 = npt.NDArray[np.float32]


class StreamingForm:
    """A windowed network in its streaming form, see `sensor.streaming.graph`.

    `output` (1, 4) [m/s] is the same array at every step.
    """

    def __init__(self, session: ort.InferenceSession) -> None:
        shapes = {node.name: node.shape for node in session.get_inputs()}
        rows, units = (int(size) for size in shapes["cell"])
        self._session = session
        self._window = rows - 1
        self._measured = np.zeros((1, len(CHANNELS)), dtype=np.float32)
        self.output = np.zeros((1, len(OUTPUTS)), dtype=np.float32)
        # Two of each: a sample reads one and writes the other. The new cells are written one row
        # behind the start, where the next sample reads them with the row of zeros before them.
        self._hidden = [np.zeros((rows, units), dtype=np.float32) for _ in range(2)]
        self._cell = [np.zeros((rows + 1, units), dtype=np.float32) for _ in range(2)]
        self._backward = [cell[self._window] for cell in self._cell]
        self._bindings = [self._bind(0), self._bind(1)]
        self._count = 0

    def fresh(self) -> "StreamingForm":
        """Return the same network with a state of its own."""
        return StreamingForm(self._session)

    def reset(self) -> None:
        """Forget all samples."""
        for state in (*self._hidden, *self._cell):
            state.fill(0.0)
        self._count = 0

    def take(self, measured: Array) -> bool:
        """Take one sample (14,) in SI units; return whether `output` counts, which it does from the
        W-th sample on. A NaN is in exactly the W outputs whose windows hold it.
        """
        turn = self._count & 1
        self._measured[0] = measured
        self._backward[turn].fill(0.0)
        self._session.run_with_iobinding(self._bindings[turn])
        self._count += 1
        return self._count >= self._window

    def _bind(self, turn: int) -> ort.IOBinding:
        """Tie inputs and outputs to our arrays, whose memory never moves."""
        rows = self._window + 1
        binding = self._session.io_binding()
        inputs = {
            "measured": self._measured,
            "hidden": self._hidden[turn][: self._window - 1],
            "cell": self._cell[turn][:rows],
        }
        outputs = {
            "estimate": self.output,
            "next_hidden": self._hidden[1 - turn],
            "next_cell": self._cell[1 - turn][1:],
        }
        for bind, arrays in ((binding.bind_input, inputs), (binding.bind_output, outputs)):
            _tie(bind, arrays)
        return binding


def _tie(bind: Any, arrays: dict[str, Float32]) -> None:
    for name, array in arrays.items():
        bind(name, "cpu", 0, np.float32, array.shape, array.ctypes.data)
