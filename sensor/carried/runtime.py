"""The network with carried state at run time: one sample in, one estimate out, by ONNX Runtime on
one thread.
"""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import onnxruntime as ort

from sensor.channels import CHANNEL_NAMES, COMMANDS, OUTPUTS
from sensor.errors import SensorError
from sensor.estimator import sample_by_sample
from sensor.runtime import open_session, read_info
from sensor.window import check_sample

# What sensors may say, far beyond what a car ever does: a garbled sample must not be squared into
# infinity, or the state would never come back from it
LARGEST = np.array(
    [*3 * (80.0,), *3 * (10.0,), 120.0, *2 * (1.2,), *4 * (120.0,), 20.0]
)  # m/s2, rad/s, m/s, rad, m/s, rad
LEAST = -LARGEST
STATES = ("samples", "energy", "means", "integrals", "line", "hidden", "cell")
WARM_UP = 50  # samples until the carried state has settled and an estimate counts

Array = npt.NDArray[np.float64]


class CarriedSensor:
    """A network with carried state as a streaming sensor.

    `estimate` and its predicted standard `deviation` (4,) [m/s] are the same arrays at every step,
    NaN for the first half second. Two sets of state arrays take turns as the network's input and
    output; nothing is allocated per step beyond what ONNX Runtime itself does.
    """

    warm_up = WARM_UP

    def __init__(self, model: str | Path) -> None:
        """Open the file; raises SensorError if it is no network of this kind."""
        self._session = open_session(Path(model))
        self.info = read_info(self._session, str(model))
        if self.info.kind != "carried":
            raise SensorError(f"{model}: it carries no state from sample to sample.")
        self._measured = np.zeros((1, len(CHANNEL_NAMES)), dtype=np.float32)
        self._command = np.zeros((1, len(COMMANDS)), dtype=np.float32)
        self._output = np.zeros((2, 1, len(OUTPUTS)), dtype=np.float32)
        shapes = {node.name: node.shape for node in self._session.get_inputs()}
        self._states = [
            {name: np.zeros(shapes[name], dtype=np.float32) for name in STATES} for _ in range(2)
        ]
        self._bindings = [self._bind(0), self._bind(1)]
        self._within = np.zeros(len(CHANNEL_NAMES))
        self._count = 0
        self.estimate = np.full(len(OUTPUTS), np.nan)
        self.deviation = np.full(len(OUTPUTS), np.nan)

    def reset(self) -> None:
        """Forget all samples."""
        for states in self._states:
            for array in states.values():
                array.fill(0.0)
        self._count = 0
        self.estimate.fill(np.nan)
        self.deviation.fill(np.nan)

    def step(self, measured: Array, command: Array) -> bool:
        """Take one sample (14,) and the damper command (4,) held until it; return whether the
        estimate counts.

        Finite values beyond `LARGEST` are cut off there. Raises SensorError naming the channel if
        the sample holds a NaN or infinity; such a sample is not taken.
        """
        check_sample(measured)
        np.clip(measured, LEAST, LARGEST, out=self._within)
        self._measured[0] = self._within
        self._command[0] = command
        self._session.run_with_iobinding(self._bindings[self._count % 2])
        self._count += 1
        if self._count <= self.warm_up:
            return False
        self.estimate[:] = self._output[0, 0]
        self.deviation[:] = self._output[1, 0]
        return True

    def apply(
        self, channels: npt.NDArray[np.floating[Any]], commands: npt.NDArray[np.floating[Any]]
    ) -> Array:
        """Estimate a whole run from a fresh start: (samples, 14), (samples, 4) -> (samples, 4)."""
        return self.apply_with_deviation(channels, commands)[0]

    def apply_with_deviation(
        self, channels: npt.NDArray[np.floating[Any]], commands: npt.NDArray[np.floating[Any]]
    ) -> tuple[Array, Array]:
        """Estimates and deviations (samples, 4) [m/s] of a whole run, NaN for the first half
        second; `step`'s state is lost.
        """
        return sample_by_sample(self, channels, commands)

    def _bind(self, turn: int) -> ort.IOBinding:
        """Tie inputs and outputs to our arrays, whose memory never moves."""
        before, after = self._states[turn], self._states[1 - turn]
        inputs = {"measured": self._measured, "command": self._command, **before}
        outputs = {"estimate": self._output[0], "deviation": self._output[1]}
        outputs |= {f"next_{name}": array for name, array in after.items()}
        binding = self._session.io_binding()
        for bind, arrays in ((binding.bind_input, inputs), (binding.bind_output, outputs)):
            for name, array in arrays.items():
                bind(name, "cpu", 0, np.float32, array.shape, array.ctypes.data)
        return binding
