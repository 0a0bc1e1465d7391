"""The vehicle's C sources as a library that answers for one part of the plant at a time."""

from __future__ import annotations

import atexit
import ctypes
import functools
import subprocess
import tempfile
import weakref
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from fmu_face import ROOT, build, generate, toolchain, variables

Array = npt.NDArray[np.float64]

VEHICLE = ROOT / "fmu" / "vehicle"
PROBE = ROOT / "tests" / "vehicle_probe" / "probe.c"
FLAGS = ["-std=c11", *toolchain.PORTABLE, "-Wall", "-Wextra", "-Werror"]

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
_POINTER, _REAL, _INT = ctypes.c_void_p, ctypes.c_double, ctypes.c_int
SIGNATURES: dict[str, tuple[Any, ...]] = {  # result, arguments
    "new": (_POINTER,),
    "free": (None, _POINTER),
    "set": (_INT, _POINTER, ctypes.c_char_p, _REAL),
    "prepare": (_INT, _POINTER),
    "multibody": (None, _POINTER, _POINTER, _POINTER),
    "magic_formula": (None, _POINTER, *[_REAL] * 5, _POINTER),
    "relaxation_y": (_REAL, _POINTER, _REAL, _REAL),
    "rolling_radius": (_REAL, _POINTER, _REAL, _REAL),
    "tyre": (None, _POINTER, _POINTER, _INT, _POINTER),
    "damper": (_REAL, _POINTER, _INT, _REAL),
    "encoder": (None, _POINTER, _INT, _INT, _REAL, _POINTER, _POINTER),
    "elementary": (None, _INT, _INT, _POINTER, _POINTER),
}


@functools.cache
def library() -> Path:
    """The probe compiled with the vehicle's sources, once for all tests of a session."""
    temporary = tempfile.TemporaryDirectory()
    atexit.register(temporary.cleanup)
    folder = Path(temporary.name)
    table = variables.read_table(VEHICLE / "variables.toml")
    (folder / "variables.h").write_text(generate.header(table), encoding="utf-8")
    (folder / "variables.c").write_text(generate.source(table, "{}"), encoding="utf-8")
    sources = sorted(VEHICLE.glob("*.c"))
    include = [f"-I{path}" for path in (folder, VEHICLE, ROOT / "fmu" / "common")]
    target = folder / "probe.so"
    command = [
        *[*build.compiler(None), *FLAGS, *include, "-shared", "-fPIC", str(PROBE)],
        *[*map(str, sources), str(folder / "variables.c"), "-o", str(target), "-lm"],
    ]
    subprocess.run(command, check=True)
    return target


@functools.cache
def table_values() -> dict[str, float]:
    """Start values of the vehicle's numeric variables by name, SI."""
    table = variables.read_table(VEHICLE / "variables.toml")
    return {v.name: float(v.start) for v in table.variables if v.type != "String"}


class Probe:
    """One parameterisation of the plant; corner order FL FR RL RR, SI units, ISO 8855 axes.

    `settings` (by variable name) go over the table's start values. Raises KeyError for a name that
    the table does not have, ValueError where the vehicle refuses the parameters.
    """

    def __init__(self, settings: dict[str, float] | None = None) -> None:
        self._lib = ctypes.CDLL(str(library()))
        for name, (result, *arguments) in SIGNATURES.items():
            function = getattr(self._lib, f"probe_{name}")
            function.restype, function.argtypes = result, arguments
        self._plant = self._lib.probe_new()
        weakref.finalize(self, self._lib.probe_free, self._plant)
        self.parameters = {**table_values(), **(settings or {})}
        for name, value in (settings or {}).items():
            if self._lib.probe_set(self._plant, name.encode(), value) != 0:
                raise KeyError(name)
        if self._lib.probe_prepare(self._plant) != 0:
            raise ValueError("the vehicle refuses these parameters")

    def multibody(self, motion: npt.NDArray[np.void]) -> Any:
        """Accelerations and kinetic energy (a RESPONSE record) of a MOTION record."""
        response = np.zeros((), RESPONSE)
        self._lib.probe_multibody(self._plant, motion.ctypes.data, response.ctypes.data)
        return response

    def magic_formula(
        self, Fz: float, kappa: float, tan_alpha: float, gamma: float, side: float
    ) -> dict[str, float]:
        """Fx, Fy, Mz and both friction peaks; side 1 left, -1 right."""
        out = np.zeros(5)
        self._lib.probe_magic_formula(
            self._plant, Fz, kappa, tan_alpha, gamma, side, out.ctypes.data
        )
        return dict(zip(FORCE_NAMES, out.tolist(), strict=True))

    def tyre(self, corner: int, **rolling: float | tuple[float, float, float]) -> dict[str, float]:
        """Tyre of one corner on a flat road, from the fields of ROLLING."""
        given, out = np.zeros((), ROLLING), np.zeros(len(GRIP_NAMES))
        for name, value in rolling.items():
            given[name] = value
        self._lib.probe_tyre(self._plant, given.ctypes.data, corner, out.ctypes.data)
        return dict(zip(GRIP_NAMES, out.tolist(), strict=True))

    def encoder(self, angle: Array, steps: int, h: float) -> Array:
        """Readings [rad/s] of the wheel-speed sensor, one per `steps` internal steps of h [s], of
        a wheel that stands at angle[k] [rad] at k h.
        """
        angle = np.ascontiguousarray(angle, dtype=np.float64)
        out = np.empty((len(angle) - 1) // steps)
        self._lib.probe_encoder(self._plant, len(out), steps, h, angle.ctypes.data, out.ctypes.data)
        return out

    def elementary(self, which: int, x: Array) -> Array:
        """The plant's own sine (0), cosine (1), arctangent (2) or exponential (3) of each x."""
        x = np.ascontiguousarray(x, dtype=np.float64)
        out = np.empty_like(x)
        self._lib.probe_elementary(which, len(x), x.ctypes.data, out.ctypes.data)
        return out

    def relaxation_y(self, Fz: float, radius: float) -> float:
        """Lateral relaxation length."""
        return float(self._lib.probe_relaxation_y(self._plant, Fz, radius))

    def rolling_radius(self, Fz: float, radius: float) -> float:
        """Effective rolling radius."""
        return float(self._lib.probe_rolling_radius(self._plant, Fz, radius))

    def damper(self, which: int, velocity: float) -> float:
        """Force of the passive (0), soft (1) or hard (2) curve, front wheel."""
        return float(self._lib.probe_damper(self._plant, which, velocity))
