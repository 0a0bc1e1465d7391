"""The C sensor as a shared library, run sample by sample, and networks to run it on."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch

from sensor.carried.graph import export_carried
from sensor.carried.network import CarriedConfig, CarriedNetwork
from sensor.channels import CHANNEL_NAMES
from sensor.export import export_windowed
from sensor.features import WHEEL_SPEEDS
from sensor.network import BiLstmNetwork, NetworkConfig

Array = npt.NDArray[np.float64]

SOURCES = Path(__file__).parents[1] / "fmu" / "sensor"
CORE = [
    f"{name}.c"
    for name in ("network", "packed", "windowed", "carried", "carried_features", "residual")
]
FLAGS = [
    *("-std=c11", "-Wall", "-Wextra", "-Werror", "-O3", "-ffp-contract=off"),
    *("-fno-math-errno", "-fno-trapping-math"),
]
ALIGNMENT = 64
LAYOUT_ROOM = 512  # bytes, more than a Network takes


def compile_sensor(target: Path, *flags: str, program: Path | None = None) -> Path:
    """Compile the C sensor: a shared library, or a program with `program` as its main file."""
    sources = sorted(
        str(path) for path in SOURCES.glob("*.c") if not path.name.startswith("sensor")
    )
    kind = ["-shared", "-fPIC"] if program is None else [str(program)]
    command = ["cc", *FLAGS, *flags, f"-I{SOURCES}", *kind, *sources, "-o", str(target), "-lm"]
    subprocess.run(command, check=True)
    return target


def load_library(path: Path) -> ctypes.CDLL:
    library = ctypes.CDLL(str(path))
    pointer, size = ctypes.c_void_p, ctypes.c_size_t
    library.network_open.restype = ctypes.c_char_p
    library.network_open.argtypes = [pointer, pointer, size]
    for name in ("network_state_bytes", "network_scratch_bytes"):
        getattr(library, name).restype = size
        getattr(library, name).argtypes = [pointer]
    library.network_reset.argtypes = [pointer] * 2
    library.network_step.restype = ctypes.c_bool
    library.network_step.argtypes = [pointer] * 8
    for name in ("network_uses_command", "network_predicts_deviation"):
        getattr(library, name).restype = ctypes.c_bool
        getattr(library, name).argtypes = [pointer]
    library.network_kernel.restype = ctypes.c_char_p
    library.network_choose_kernel.restype = ctypes.c_bool
    library.network_choose_kernel.argtypes = [ctypes.c_char_p]
    return library


def kernels(library: ctypes.CDLL) -> list[str]:
    """Return the kernels that this machine can run, best first."""
    names = ("avx512", "avx2", "sse2", "neon", "portable")
    found = [name for name in names if library.network_choose_kernel(name.encode())]
    library.network_choose_kernel(found[0].encode())
    return found


def aligned(size: int, offset: int = 0) -> npt.NDArray[np.uint8]:
    """Return zeroed bytes that begin `offset` bytes behind a multiple of 64."""
    room = np.zeros(size + 2 * ALIGNMENT, dtype=np.uint8)
    start = -room.ctypes.data % ALIGNMENT + offset
    return room[start : start + size]


class PackedSensor:
    """One instance; `step` as the estimators' of `sensor`. Raises ValueError with the C sensor's
    own sentence.
    """

    def __init__(self, library: ctypes.CDLL, blob: bytes) -> None:
        self._lib = library
        self._blob = aligned(len(blob))
        self._blob[:] = np.frombuffer(blob, dtype=np.uint8)
        self._network = aligned(LAYOUT_ROOM)
        wrong = library.network_open(self._network.ctypes.data, self._blob.ctypes.data, len(blob))
        if wrong:
            raise ValueError(wrong.decode("ascii"))
        self.state = aligned(library.network_state_bytes(self._network.ctypes.data))
        self._scratch = aligned(library.network_scratch_bytes(self._network.ctypes.data))
        self.estimate, self.deviation = np.full(4, np.nan), np.full(4, np.nan)
        self.bad = 0
        self.reset()

    def reset(self) -> None:
        self._lib.network_reset(self._network.ctypes.data, self.state.ctypes.data)

    def step(self, measured: Array, command: Array) -> bool:
        x, u = (np.ascontiguousarray(a, dtype=np.float64) for a in (measured, command))
        bad = ctypes.c_uint(99)
        counts = self._lib.network_step(
            *(a.ctypes.data for a in (self._network, self.state, self._scratch, x, u)),
            *(a.ctypes.data for a in (self.estimate, self.deviation)),
            ctypes.addressof(bad),
        )
        self.bad = bad.value
        return bool(counts)

    def move_state(self, offset: int) -> None:
        """Continue with a copy of the state elsewhere; the old one and the scratch are spoilt."""
        copy = aligned(len(self.state), offset)
        copy[:] = self.state
        self.state.fill(0xFF)
        self._scratch.fill(0xFF)
        self.state = copy

    def run(self, channels: Array, commands: Array) -> tuple[Array, Array]:
        """Return estimates and deviations (samples, 4), NaN where they do not count."""
        result = np.full((2, len(channels), 4), np.nan)
        for k in range(len(channels)):
            if self.step(channels[k], commands[k]):
                result[:, k] = self.estimate, self.deviation
        return result[0], result[1]


def drive(samples: int, seed: int = 1) -> tuple[Array, Array]:
    """Return channels (samples, 14) of a car that speeds up, and commands (samples, 4)."""
    random = np.random.default_rng(seed)
    channels = random.normal(scale=0.3, size=(samples, 14))
    channels[:, [3, 4, 5, 7, 8, 13]] *= 0.1
    speed = np.linspace(0.5, 35.0, samples)
    channels[:, CHANNEL_NAMES.index("Car.vx")] = speed
    channels[:, WHEEL_SPEEDS] = speed[:, np.newaxis] + random.normal(scale=0.02, size=(samples, 4))
    return channels, random.uniform(size=(samples, 4))


def windowed_network(window: int, units: int, hidden: int, residual: bool) -> BiLstmNetwork:
    """A network of random weights, larger than at the start of a training."""
    torch.manual_seed(window + 100 * units)
    network = BiLstmNetwork(
        NetworkConfig(window=window, units=units, hidden=hidden, residual=residual)
    )
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.mul_(1.5)
    network.input_mean.uniform_(-0.1, 0.1)
    network.input_std.uniform_(0.1, 0.5)
    network.input_mean[6], network.input_std[6] = 15.0, 10.0
    if not residual:
        network.input_mean[9:13], network.input_std[9:13] = 15.0, 10.0
    network.output_mean.uniform_(-0.01, 0.01)
    network.output_std.uniform_(0.05, 0.3)
    return network.eval()


def carried_network(front: int, units: int, hidden: int) -> CarriedNetwork:
    torch.manual_seed(units)
    network = CarriedNetwork(CarriedConfig(front=front, units=units, hidden=hidden))
    network.mean.uniform_(-0.1, 0.1)
    network.std.uniform_(0.5, 2.0)
    network.calibration.uniform_(0.5, 1.5)
    return network.eval()


def exported(network: BiLstmNetwork | CarriedNetwork, folder: Path) -> Path:
    path = folder / "network.onnx"
    if isinstance(network, CarriedNetwork):
        return export_carried(network, path)
    return export_windowed(network, path)
