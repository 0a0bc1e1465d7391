"""A sensor FMU takes nothing from the heap between its instantiation and its end."""

from __future__ import annotations

import ctypes
import math
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
import shipped_fmus as fmus
from fmu_face import instances
from sensor_rig import Sensor, signal

COUNTER = Path(__file__).with_name("allocations.c")


@pytest.mark.skipif(
    platform.libc_ver()[0] != "glibc", reason="counts by a library that glibc preloads"
)
@pytest.mark.parametrize("fmu", [fmus.SMALL[0], fmus.SMALL[3]], ids=str)
def test_nothing_is_allocated_after_instantiation(fmu: fmus.Shipped, tmp_path: Path) -> None:
    library = tmp_path / "allocations.so"
    subprocess.run(["cc", "-shared", "-fPIC", str(COUNTER), "-o", str(library), "-ldl"], check=True)
    with fmus.unzipped(fmu) as folder:
        said = subprocess.run(
            [sys.executable, __file__, str(folder)],
            env={**os.environ, "LD_PRELOAD": str(library)},
            capture_output=True, text=True, check=True,
        ).stdout  # fmt: skip
    instantiated, lived, saved = map(int, said.split())
    assert instantiated >= 5  # instance, name, resources, network, state: the counter counts
    assert lived == 0
    assert saved == 1


def live(folder: Path) -> tuple[int, int, int]:
    """Allocations of an instantiation, of a life with gaps, missed samples and a reset, and of a
    saved state.
    """
    count = ctypes.CDLL(None).allocations
    count.restype = ctypes.c_long
    before = count()
    with instances(Sensor, folder) as make:
        face = make()
        instantiated = count()
        channels, commands = (part.copy() for part in signal(200))
        channels[70:75, 3] = math.nan
        for step in (0.01, 0.003, 0.03):
            face.start()
            for k, (row, command) in enumerate(zip(channels, commands, strict=True)):
                face.feed(row, command)
                face.set_status("Car.az", 1e6 if k == 80 else row[2])
                face.step(k, step)
                face.read()
            face.fmu.reset()
        lived = count()
        state = face.fmu.getFMUState()
        saved = count()
        face.fmu.freeFMUState(state)
    return instantiated - before, lived - instantiated, saved - lived


if __name__ == "__main__":
    print(*live(Path(sys.argv[1])))
