"""The vehicle's C sources as a library that answers for one part of the plant at a time."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from fmu_face import ROOT, build, generate, variables

Array = npt.NDArray[np.float64]

VEHICLE = ROOT / "fmu" / "vehicle"
PROBE = ROOT / "tests" / "vehicle_probe" / "probe.c"
FLAGS = ["-std=c11", "-O1", "-ffp-contract=off", "-fno-math-errno", "-Wall", "-Wextra", "-Werror"]

MOTION = np.dtype(
    [
        *[("quaternion", "f8", 4), ("velocity", "f8", 3), ("rate", "f8", 3), ("travel", "f8", 4)],
        *[("travel_rate", "f8", 4), ("spin", "f8", 4), ("compliance", "f8", 4), ("rack", "f8")],
        *[("steer_rate", "f8", 4), ("force", "f8", (4, 3)), ("moment", "f8", (4, 3))],
        *[("body_force", "f8", 3), ("body_moment", "f8", 3)],
        *[("spring_force", "f8", 4), ("damper_force", "f8", 4)],
    ]
)
RESPONSE = np.dtype(
    [
        *[("acceleration", "f8", 3), ("angular_acceleration", "f8", 3)],
        *[("travel_acceleration", "f8", 4), ("kinetic_energy", "f8"), ("r", "f8", (4, 3))],
        *[("v", "f8", (4, 3)), ("rate", "f8", (4, 3)), ("axle", "f8", (4, 3))],
    ]
)
ROLLING = np.dtype(
    [
        *[("deflection", "f8"), ("deflection_rate", "f8"), ("sine_inclination", "f8")],
        *[("spin", "f8"), ("stretch_x", "f8"), ("stretch_y", "f8"), ("velocity", "f8", 3)],
    ]
)
GRIP_NAMES = (
    *("Fx", "Fy", "Fz", "Mz", "My", "slip_x", "slip_y", "stretch_x_rate", "stretch_y_rate"),
    *("dissipation", "peak_x", "peak_y"),
)
FORCE_NAMES = ("Fx", "Fy", "Mz", "peak_x", "peak_y")


def compile_probe(folder: Path) -> Path:
    """Compile the probe with the vehicle's sources; returns the shared library."""
    table = variables.read_table(VEHICLE / "variables.toml")
    (folder / "variables.h").write_text(generate.header(table), encoding="utf-8")
    (folder / "variables.c").write_text(generate.source(table, "{}"), encoding="utf-8")
    sources = [path for path in sorted(VEHICLE.glob("*.c")) if path.name != "tyre.c"]
    include = [f"-I{path}" for path in (folder, VEHICLE, ROOT / "fmu" / "common")]
    target = folder / "probe.so"
    command = [
        *[*build.compiler(None), *FLAGS, *include, "-shared", "-fPIC", str(PROBE)],
        *[*map(str, sources), str(folder / "variables.c"), "-o", str(target), "-lm"],
    ]
    subprocess.run(command, check=True)
    return target


def table_values() -> dict[str, float]:
    """Start values of the vehicle's numeric variables by name, SI."""
    table = variables.read_table(VEHICLE / "variables.toml")
    return {v.name: float(v.start) for v in table.variables if v.type != "String"}


class Probe:
    """One parameterisation of the plant; corner order FL FR RL RR, SI units, ISO 8855 axes."""

    def __init__(self, library: Path, settings: dict[str, float] | None = None) -> None:
        self._lib = ctypes.CDLL(str(library))
        for name in ("relaxation_y", "rolling_radius"):
            getattr(self._lib, f"probe_{name}").argtypes = [ctypes.c_double] * 2
            getattr(self._lib, f"probe_{name}").restype = ctypes.c_double
        self._lib.probe_set.argtypes = [ctypes.c_char_p, ctypes.c_double]
        self._lib.probe_damper.argtypes = [ctypes.c_int, ctypes.c_double]
        self._lib.probe_damper.restype = ctypes.c_double
        self._lib.probe_magic_formula.argtypes = [*[ctypes.c_double] * 5, ctypes.c_void_p]
        self.parameters: dict[str, float] = {}
        self.configure(settings or {})

    def configure(self, settings: dict[str, float]) -> None:
        """Take the table's start values with `settings` (by variable name) over them."""
        self._lib.probe_reset()
        for name, value in settings.items():
            if self._lib.probe_set(name.encode(), value) != 0:
                raise KeyError(name)
        if self._lib.probe_prepare() != 0:
            raise ValueError("the vehicle refuses these parameters")
        self.parameters = {**table_values(), **settings}

    def multibody(self, motion: npt.NDArray[np.void]) -> Any:
        """Accelerations and kinetic energy (a RESPONSE record) of a MOTION record."""
        response = np.zeros((), RESPONSE)
        self._lib.probe_multibody(
            ctypes.c_void_p(motion.ctypes.data), ctypes.c_void_p(response.ctypes.data)
        )
        return response

    def magic_formula(
        self, Fz: float, kappa: float, tan_alpha: float, gamma: float, side: float
    ) -> dict[str, float]:
        """Fx, Fy, Mz and both friction peaks; side 1 left, -1 right."""
        out = np.zeros(5)
        self._lib.probe_magic_formula(Fz, kappa, tan_alpha, gamma, side, out.ctypes.data)
        return dict(zip(FORCE_NAMES, out.tolist(), strict=True))

    def tyre(self, corner: int, **rolling: float | tuple[float, float, float]) -> dict[str, float]:
        """Tyre of one corner on a flat road, from the fields of ROLLING."""
        given, out = np.zeros((), ROLLING), np.zeros(len(GRIP_NAMES))
        for name, value in rolling.items():
            given[name] = value
        self._lib.probe_tyre(
            ctypes.c_void_p(given.ctypes.data), corner, ctypes.c_void_p(out.ctypes.data)
        )
        return dict(zip(GRIP_NAMES, out.tolist(), strict=True))

    def relaxation_y(self, Fz: float, radius: float) -> float:
        """Lateral relaxation length."""
        return float(self._lib.probe_relaxation_y(Fz, radius))

    def rolling_radius(self, Fz: float, radius: float) -> float:
        """Effective rolling radius."""
        return float(self._lib.probe_rolling_radius(Fz, radius))

    def damper(self, which: int, velocity: float) -> float:
        """Force of the passive (0), soft (1) or hard (2) curve, front wheel."""
        return float(self._lib.probe_damper(which, velocity))
