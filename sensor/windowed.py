"""The windowed form at run time: the whole window goes through the network at every sample."""

import numpy as np
import numpy.typing as npt
import onnxruntime as ort

from sensor.channels import OUTPUTS
from sensor.window import Window


class WindowedForm:
    """A windowed network as it stands in its file.

    `output` (1, 4) [m/s] is the same array at every step.
    """

    def __init__(self, session: ort.InferenceSession, window: int) -> None:
        self._session = session
        self._window = Window(window)
        self.output = np.zeros((1, len(OUTPUTS)), dtype=np.float32)
        self._binding = self._bind()

    def fresh(self) -> "WindowedForm":
        """Return the same network with a window of its own."""
        return WindowedForm(self._session, len(self._window.values))

    def reset(self) -> None:
        """Forget all samples."""
        self._window.reset()

    def take(self, measured: npt.NDArray[np.float64]) -> bool:
        """Take one sample (14,) in SI units; return whether `output` counts, which it does from the
        W-th sample on.
        """
        if not self._window.push(measured):
            return False
        self._session.run_with_iobinding(self._binding)
        return True

    def _bind(self) -> ort.IOBinding:
        """Tie the network's input and output to our two arrays, whose memory never moves."""
        binding = self._session.io_binding()
        for bind, node, array in (
            (binding.bind_input, self._session.get_inputs()[0], self._window.values[np.newaxis]),
            (binding.bind_output, self._session.get_outputs()[0], self.output),
        ):
            bind(node.name, "cpu", 0, np.float32, array.shape, array.ctypes.data)
        return binding
