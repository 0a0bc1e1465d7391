"""Networks in the C sensor: by a call, in the FMU, and its instructions counted."""

from __future__ import annotations

import ctypes
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from network_forms import Form

from sensor.channels import CHANNELS, COMMANDS, OUTPUTS
from sensor.packed import blob, read_network

sys.path.insert(0, str(Path(__file__).parents[1]))
from packed_sensor import PackedSensor, compile_sensor, load_library

Array = npt.NDArray[np.float64]
KERNELS: Final = ("avx512", "avx2", "sse2", "neon", "portable")
COMMAND: Final = 0.3
STEP_S: Final = 0.01
FEW, MANY = 52, 54  # steps, both with the window full
_TOTAL = re.compile(r"^ *([\d,]+)[ (].*PROGRAM TOTALS", re.MULTILINE)


class CSensor:
    """The C sensor on one network, called with arguments that were wrapped beforehand.

    `estimate` (4,) [m/s] is the same array at every step; `instance_bytes` are state and scratch,
    `network_bytes` the packed weights, which instances may share.
    """

    def __init__(self, library: ctypes.CDLL, model: Path) -> None:
        packed = blob(read_network(model))
        self._sensor = PackedSensor(library, packed)
        self._measured, self._bad = np.zeros(len(CHANNELS)), ctypes.c_uint()
        self._command = np.full(len(COMMANDS), COMMAND)
        self.estimate = self._sensor.estimate
        s = self._sensor
        arrays = (s._network, s.state, s._scratch, self._measured, self._command)
        outputs = (s.estimate, s.deviation)
        pointers = [ctypes.c_void_p(a.ctypes.data) for a in (*arrays, *outputs)]
        self._arguments = (*pointers, ctypes.c_void_p(ctypes.addressof(self._bad)))
        self._step = library.network_step
        self.instance_bytes = len(s.state) + len(s._scratch)
        self.network_bytes = len(packed)

    def take(self, sample: Array) -> None:
        """Take one sample (14,)."""
        self._measured[:] = sample
        self._step(*self._arguments)


def kernels(library: ctypes.CDLL) -> list[str]:
    """Return the instruction sets that library and machine have, the widest first."""
    return [name for name in KERNELS if library.network_choose_kernel(name.encode())]


def c_forms(library: ctypes.CDLL, model: Path) -> Iterator[Form]:
    """Yield the C sensor with each instruction set that this machine has."""
    for name in kernels(library):
        library.network_choose_kernel(name.encode())
        sensor = CSensor(library, model)
        yield Form(f"C, {name}", sensor.take, lambda sensor=sensor: sensor.estimate)  # type: ignore[misc]
    library.network_choose_kernel(kernels(library)[0].encode())


def compiled(folder: Path) -> ctypes.CDLL:
    """Return the C sensor as a library."""
    return load_library(compile_sensor(folder / "sensor.so"))


class FmuByFmpy:
    """The sensor FMU by the raw functions of FMPy's loaded library, with arrays wrapped beforehand:
    inputs set, a step of 10 ms, estimates and validity read.
    """

    def __init__(self, fmu: Path) -> None:
        import fmpy
        from fmpy.fmi3 import FMU3Slave

        description = fmpy.read_model_description(str(fmu))
        identifier = description.coSimulation.modelIdentifier
        self._fmu: Any = FMU3Slave(
            guid=description.guid, unzipDirectory=fmpy.extract(str(fmu)), modelIdentifier=identifier
        )
        self._fmu.instantiate()
        self._fmu.enterInitializationMode()
        self._fmu.exitInitializationMode()
        reference = {v.name: v.valueReference for v in description.modelVariables}
        inputs = np.array([reference[c.name] for c in CHANNELS], dtype=np.uint32)
        outputs = np.array([reference[o.name] for o in OUTPUTS], dtype=np.uint32)
        flag = np.array([reference["Sensor.Valid"]], dtype=np.uint32)
        self._kept = (inputs, outputs, flag)
        self._measured, self.estimate = np.zeros(len(CHANNELS)), np.zeros(len(OUTPUTS))
        self._valid = np.zeros(1, dtype=np.bool_)
        self._set = self._arguments(inputs, self._measured)
        self._get = self._arguments(outputs, self.estimate)
        self._get_flag = self._arguments(flag, self._valid)
        self._flags = [ctypes.c_bool() for _ in range(4)]
        self._last = ctypes.c_double()
        self._count = 0

    def _arguments(self, references: npt.NDArray[np.uint32], values: npt.NDArray[Any]) -> Any:
        size = ctypes.c_size_t(len(references))
        pointer = ctypes.POINTER(ctypes.c_uint32)
        kind = ctypes.c_bool if values.dtype == np.bool_ else ctypes.c_double
        array = values.ctypes.data_as(ctypes.POINTER(kind))
        return self._fmu.component, references.ctypes.data_as(pointer), size, array, size

    def take(self, sample: Array) -> None:
        """Take one sample (14,)."""
        fmu = self._fmu
        self._measured[:] = sample
        fmu.fmi3SetFloat64(*self._set)
        event, terminate, early, _ = self._flags
        fmu.fmi3DoStep(
            fmu.component, self._count * STEP_S, STEP_S, True, event, terminate, early, self._last
        )
        fmu.fmi3GetFloat64(*self._get)
        fmu.fmi3GetBoolean(*self._get_flag)
        self._count += 1


def instructions(folder: Path, model: Path) -> dict[str, float]:
    """Count the instructions of a sample with each instruction set that valgrind can run."""
    packed = folder / f"{model.stem}.bin"
    packed.write_bytes(blob(read_network(model)))
    program = compile_sensor(folder / "steps", program=Path(__file__).with_name("sensor_steps.c"))
    counts = {}
    for kernel in KERNELS:
        few, many = (_counted(program, packed, kernel, steps) for steps in (FEW, MANY))
        if few is not None and many is not None:
            counts[kernel] = (many - few) / (MANY - FEW)
    return counts


def _counted(program: Path, packed: Path, kernel: str, steps: int) -> int | None:
    """Return the instructions of a run, None where valgrind does not know the instruction set."""
    out = program.with_name(f"{kernel}_{steps}.out")
    command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}"]
    run = [*command, str(program), str(packed), kernel, str(steps)]
    if subprocess.run(run, check=False, capture_output=True).returncode:
        return None
    listed = ["callgrind_annotate", "--auto=no", str(out)]
    text = subprocess.run(listed, check=True, capture_output=True, text=True).stdout
    found = _TOTAL.search(text)
    return int(found[1].replace(",", "")) if found else None
