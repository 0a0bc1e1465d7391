"""The C sensor on a bare Cortex-M7: builds fmu/embedded with a packed network and samples in it,
and runs it on the board that QEMU emulates.

The time of the emulated processor is counted in instructions (``-icount shift=0``: one nanosecond
each), so that its timer, 25 MHz, tells how many a sample takes, to within 40.
"""

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from toolchain import BuildError, run_compiler

FOLDER = Path(__file__).resolve().parent / "embedded"
SENSOR = FOLDER.parent / "sensor"
COMPILER, SIZE, NAMES, EMULATOR = (
    *(f"arm-none-eabi-{tool}" for tool in ("gcc", "size", "nm")),
    "qemu-system-arm",
)
CORE = ("network", "packed", "windowed", "carried", "carried_features", "residual")
FLAGS = [
    *["-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16", "-mfloat-abi=hard", "-std=c11", "-O3"],
    *["-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math", "-ffreestanding"],
    *["-ffunction-sections", "-fdata-sections", "-Wall", "-Wextra", "-Werror"],
]
LINK = [
    *["-nostdlib", "-T", "mps2.ld", "-Wl,--gc-sections,-e,0", "-lm", "-lc", "-lgcc"],
]
BOARD = ["-M", "mps2-an500", "-nographic", "-monitor", "none", "-serial", "none"]
COUNTING = ["-icount", "shift=0", "-semihosting-config", "enable=on,target=native"]
PER_TICK = 40  # instructions of 1 ns in a tick of 25 MHz
STACK = 8192  # bytes that mps2.ld keeps for it
LONGEST = 600  # s


@dataclass(frozen=True)
class Firmware:
    """A program for the board, and its bytes: `code` in flash beside the `network` (samples not
    counted), `memory` in RAM without the stack, of it `state` and `scratch`.
    """

    path: Path
    code: int
    network: int
    memory: int
    state: int
    scratch: int


@dataclass(frozen=True)
class Answers:
    """Of each sample whether its estimate counts (n,), estimates and deviations (n, 4) [m/s] and
    instructions (n,); bytes of stack in use at most.
    """

    counts: npt.NDArray[np.bool_]
    estimates: npt.NDArray[np.float32]
    deviations: npt.NDArray[np.float32]
    instructions: npt.NDArray[np.int64]
    stack: int


def missing() -> str:
    """What has to be installed, as a sentence; nothing if all is there."""
    if all(shutil.which(tool) for tool in (COMPILER, SIZE, NAMES, EMULATOR)):
        return ""
    return (
        "The firmware needs Arm's bare-metal GCC with newlib and QEMU (Debian and Ubuntu: 'apt"
        " install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm')."
    )


def build(network: Any, samples: npt.NDArray[np.float64], folder: Path) -> Firmware:
    """Compile the firmware with a `sensor.packed.PackedNetwork` and samples (n, 18), channels and
    commands, inside. Raises BuildError.
    """
    from sensor.packed import blob

    if sentence := missing():
        raise BuildError(sentence)
    content = blob(network)
    folder.mkdir(parents=True, exist_ok=True)
    files = [*FOLDER.iterdir(), *SENSOR.glob("*.h"), *SENSOR.glob("kernel*.c")]
    for path in (*files, *(SENSOR / f"{name}.c" for name in CORE)):
        shutil.copy(path, folder)
    (folder / "network.bin").write_bytes(content)
    (folder / "samples.bin").write_bytes(np.ascontiguousarray(samples, dtype="<f8").tobytes())
    (folder / "sizes.h").write_text(_sizes(network), encoding="utf-8")
    sources = sorted(path.name for path in folder.iterdir() if path.suffix in (".c", ".S"))
    run_compiler([COMPILER, *FLAGS, *sources, *LINK, "-o", "firmware.elf"], folder)
    return _measured(folder / "firmware.elf", len(content), samples.nbytes)


def run(firmware: Firmware) -> Answers:
    """Run it on the emulated board. Raises BuildError if the program does not end well."""
    command = [EMULATOR, *BOARD, *COUNTING, "-kernel", str(firmware.path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST)
    said = [line.split() for line in (done.stdout + done.stderr).splitlines() if line]
    if done.returncode or not said or said[-1][0] != "stack":
        raise BuildError(f"The firmware failed: {done.stdout}{done.stderr}")
    words = np.array([[int(w, 16) for w in line[1:]] for line in said[:-1]], dtype=np.uint32)
    return Answers(
        counts=words[:, 1] != 0,
        estimates=words[:, 2:6].copy().view(np.float32),
        deviations=words[:, 6:].copy().view(np.float32),
        instructions=PER_TICK * words[:, 0].astype(np.int64),
        stack=int(said[-1][1], 16),
    )


def symbols(firmware: Firmware) -> dict[str, int]:
    """Names in the program and their sizes [bytes]."""
    text = _output([NAMES, "--print-size", str(firmware.path)])
    fields = [line.split() for line in text.splitlines()]
    return {field[-1]: int(field[1], 16) if len(field) == 4 else 0 for field in fields}


def _sizes(network: Any) -> str:
    """State and scratch of this network as constants."""
    n = network
    if n.kind == "windowed":
        shape = f"{n.window}, {n.units}"
        state = f"NETWORK_WINDOWED_STATE({shape})"
        scratch = f"NETWORK_WINDOWED_SCRATCH({shape}, {n.hidden})"
    else:
        features = n.arrays["front_W"].shape[1]
        state = f"NETWORK_CARRIED_STATE({n.units}, {int(n.arrays['depth'])})"
        scratch = f"NETWORK_CARRIED_SCRATCH({features}, {n.front}, {n.units}, {n.hidden})"
    return f"enum {{ STATE_FLOATS = {state}, SCRATCH_FLOATS = {scratch} }};\n"


def _measured(path: Path, network: int, samples: int) -> Firmware:
    text, data, bss = (int(n) for n in _output([SIZE, str(path)]).splitlines()[1].split()[:3])
    firmware = Firmware(path, text + data - network - samples, network, data + bss - STACK, 0, 0)
    found = symbols(firmware)
    return Firmware(path, firmware.code, network, firmware.memory, found["state"], found["scratch"])


def _output(command: list[str]) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout
