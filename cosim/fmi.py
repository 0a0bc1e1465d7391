"""One FMU, stepped through FMPy's loaded library: value references bound once, buffers reused.

FMPy parses, extracts, validates and loads. Its own stepping wraps every call in checks and fresh
arrays; here the same entry points are called with arguments that were wrapped beforehand.
"""

from __future__ import annotations

import ctypes
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.errors import FmuError

Array = npt.NDArray[np.float64]
Value = bool | float | str

_WARNING: Final = 1  # the largest status of both standards that lets a run go on
_STATUS: Final = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
KINDS: Final = {"Real": "Real", "Float64": "Real", "Boolean": "Boolean", "String": "String",
                 "Integer": "Integer", "Int32": "Integer"}  # fmt: skip


class Description:
    """The model description of an FMU: variables by name, and its unit definitions.

    Raises `FmuError` if the file is no FMU for co-simulation, FMI 2.0 or 3.0.
    """

    def __init__(self, path: Path) -> None:
        import fmpy

        self.path = path
        try:
            self.model: Any = fmpy.read_model_description(str(path), validate=False)
        except Exception as error:
            raise FmuError(f"{path}: not a readable FMU: {_first_line(error)}") from None
        if self.model.coSimulation is None or self.model.fmiVersion[0] not in "23":
            kind = "for co-simulation" if self.model.coSimulation else "without co-simulation"
            raise FmuError(
                f"{path}: an FMU of FMI {self.model.fmiVersion} {kind}; "
                "export it for co-simulation with FMI 2.0 or 3.0"
            )
        self.major = int(self.model.fmiVersion[0])
        self.variables: dict[str, Any] = {v.name: v for v in self.model.modelVariables}
        self.units: dict[str, Any] = {u.name: u for u in self.model.unitDefinitions}

    def unit_of(self, name: str) -> str | None:
        """Return the unit of a variable, its own or its type's; None if none is declared."""
        variable = self.variables[name]
        declared = variable.declaredType
        unit = variable.unit or (declared.unit if declared is not None else None)
        return str(unit) if unit is not None else None


class Slave:
    """An instance of an FMU whose chosen real inputs and outputs are NumPy arrays.

    `inputs` (n_in,) and the Boolean inputs `input_flags` are written by the caller before `step`;
    `outputs` (n_out,) and the Boolean outputs `flags` (n_flags,) are filled by `read`. All are in
    the FMU's own units and never move in memory. Every failing call raises `FmuError` with the
    FMU's own words.
    """

    def __init__(
        self,
        description: Description,
        inputs: Sequence[str],
        outputs: Sequence[str],
        flags: Sequence[str] = (),
        input_flags: Sequence[str] = (),
    ) -> None:
        import fmpy

        self.description = description
        self.messages: list[str] = []
        self.input_names, self.output_names = tuple(inputs), tuple(outputs)
        self.inputs: Array = np.zeros(len(inputs))
        self.flag_names, self.input_flag_names = tuple(flags), tuple(input_flags)
        self.outputs: Array = np.zeros(len(outputs))
        boolean = ctypes.c_int if description.major == 2 else ctypes.c_bool
        self.flags = np.zeros(len(flags), dtype=boolean)
        self.input_flags = np.zeros(len(input_flags), dtype=boolean)
        self._folder = fmpy.extract(str(description.path))
        self._fmu: Any = None
        try:
            self._fmu = self._load()
            self._bind()
        except Exception as error:
            self.close()
            raise error if isinstance(error, FmuError) else self._failure("load", error) from None

    # ------------------------------------------------------------ life of an instance

    def initialise(self, start_values: dict[str, Value]) -> None:
        """Set the start values (in the FMU's units) and initialise at t = 0."""
        fmu = self._fmu
        try:
            if self.description.major == 2:
                fmu.setupExperiment(startTime=0.0)
            for name, value in start_values.items():
                self._set(name, value)
            self._set_inputs()
            if self.description.major == 2:
                fmu.enterInitializationMode()
            else:
                fmu.enterInitializationMode(startTime=0.0)
            fmu.exitInitializationMode()
        except FmuError:
            raise
        except Exception as error:
            raise self._failure("initialise", error) from None

    def close(self) -> None:
        """Free the instance and the extracted files; may be called twice."""
        if self._fmu is not None:
            self._fmu.freeInstance()
            self._fmu = None
        shutil.rmtree(self._folder, ignore_errors=True)

    @property
    def held(self) -> str:
        """The real inputs as they were written last, for a message."""
        held = zip(self.input_names, self.inputs, strict=True)
        return ", ".join(f"{name} = {value:.6g}" for name, value in held)

    def read(self) -> None:
        """Fill `outputs` and `flags`."""
        self.messages.clear()
        status = self._get(*self._get_arguments)
        if self.flag_names and status <= _WARNING:
            status = self._get_flags(*self._flag_arguments)
        if status > _WARNING:
            raise self._failure("read the outputs", status)

    def step(self, k: int, h: float) -> None:
        """Hold `inputs` over [k h, k h + h] and advance by h [s]."""
        self.advance(k * h, h)

    def advance(self, t: float, h: float) -> None:
        """Hold `inputs` over [t, t + h], where the FMU stands at t, and advance by h [s]."""
        self.messages.clear()
        self._set_inputs()
        self._time.value = t
        self._step_size.value = h
        status = self._do_step(*self._step_arguments)
        if status > _WARNING:
            raise self._failure(f"step at t = {t:.6g} s", status)
        if self._ended.value:
            raise FmuError(
                f"{self.description.path.name}: ended the simulation at t = {t + h:.6g} s"
            )

    def reset(self) -> None:
        """Go back to before initialisation."""
        try:
            self._fmu.reset()
        except Exception as error:
            raise self._failure("reset", error) from None

    def save(self) -> bytes:
        """Return the serialised FMU state; `FmuError` if the FMU cannot save it."""
        self.messages.clear()
        names = ("getFMUstate", "serializeFMUstate", "freeFMUstate")
        get, serialise, free = (self._state_function(name) for name in names)
        try:
            state = get()
            try:
                return bytes(serialise(state))
            finally:
                free(state)
        except Exception as error:
            raise self._failure("save its state", error) from None

    def restore(self, saved: bytes) -> None:
        """Go back to a state of `save`, of this instance or another one of the same FMU."""
        self.messages.clear()
        names = ("deSerializeFMUstate", "setFMUstate", "freeFMUstate")
        read, put, free = (self._state_function(name) for name in names)
        try:
            state = read(saved)
            try:
                put(state)
            finally:
                free(state)
        except Exception as error:
            raise self._failure("restore its state", error) from None

    # ------------------------------------------------------------ below: FMI ceremony

    def _state_function(self, name: str) -> Any:
        """Return FMPy's wrapper of a state function, which FMI 3 spells with capitals."""
        if self.description.major == 3:
            name = name.replace("FMUstate", "FMUState").replace("deSerialize", "deserialize")
        return getattr(self._fmu, name)

    def _load(self) -> Any:
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        model = self.description.model
        kind = FMU2Slave if self.description.major == 2 else FMU3Slave
        fmu = kind(
            guid=model.guid,
            unzipDirectory=self._folder,
            modelIdentifier=model.coSimulation.modelIdentifier,
            instanceName=self.description.path.stem,
        )
        if self.description.major == 2:
            fmu.instantiate(callbacks=self._callbacks(), loggingOn=False)
        else:
            fmu.instantiate(loggingOn=False, logMessage=self._log3)
        return fmu

    def _callbacks(self) -> Any:
        from fmpy import calloc, fmi2, free
        from fmpy.logging import addLoggerProxy

        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._log2)
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(ctypes.byref(callbacks))
        return callbacks

    def _log2(
        self, _environment: Any, _name: bytes, _status: int, _category: bytes, text: bytes
    ) -> None:
        self.messages.append(_plain(text))

    def _log3(self, _environment: Any, _status: int, _category: bytes, text: bytes) -> None:
        self.messages.append(_plain(text))

    def _bind(self) -> None:
        """Wrap the arguments of the three calls of the loop, once."""
        major = self.description.major
        component = ctypes.c_void_p(self._fmu.component)
        self._time, self._step_size = ctypes.c_double(), ctypes.c_double()
        self._ended = ctypes.c_bool()  # FMI 3: terminateSimulation
        pointer, size, double, number = (
            ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double, ctypes.c_int,
        )  # fmt: skip
        access = [pointer, pointer, size, pointer] + ([size] if major == 3 else [])
        self._get = self._function("fmi2GetReal" if major == 2 else "fmi3GetFloat64", access)
        self._put = self._function("fmi2SetReal" if major == 2 else "fmi3SetFloat64", access)
        self._get_flags = self._function(f"fmi{major}GetBoolean", access)
        self._put_flags = self._function(f"fmi{major}SetBoolean", access)
        self._get_arguments = self._access(component, self.output_names, self.outputs)
        self._flag_arguments = self._access(component, self.flag_names, self.flags)
        self._put_arguments = self._access(component, self.input_names, self.inputs)
        self._put_flag_arguments = self._access(component, self.input_flag_names, self.input_flags)
        if major == 2:
            signature = [pointer, double, double, number]
            self._step_arguments: tuple[Any, ...] = (
                component, self._time, self._step_size, ctypes.c_int(1),
            )  # fmt: skip
        else:
            signature = [pointer, double, double, ctypes.c_bool] + [pointer] * 4
            self._event, self._early = ctypes.c_bool(), ctypes.c_bool()
            self._last_time = ctypes.c_double()
            answers = (self._event, self._ended, self._early, self._last_time)
            self._step_arguments = (
                component, self._time, self._step_size, ctypes.c_bool(True),
                *(pointer(ctypes.addressof(answer)) for answer in answers),
            )  # fmt: skip
        self._do_step = self._function(f"fmi{major}DoStep", signature)

    def _function(self, name: str, arguments: list[Any]) -> Any:
        address = ctypes.cast(getattr(self._fmu.dll, name), ctypes.c_void_p).value
        return ctypes.CFUNCTYPE(ctypes.c_int, *arguments)(address or 0)

    def _access(
        self, component: Any, names: Sequence[str], values: npt.NDArray[Any]
    ) -> tuple[Any, ...]:
        references = np.array(
            [self.description.variables[name].valueReference for name in names], np.uint32
        )
        size = ctypes.c_size_t(len(names))
        wrapped = (
            component,
            ctypes.c_void_p(references.ctypes.data),
            size,
            ctypes.c_void_p(values.ctypes.data),
        )
        self.__dict__.setdefault("_kept_alive", []).append(references)
        return (*wrapped, size) if self.description.major == 3 else wrapped

    def _set_inputs(self) -> None:
        status = 0
        if self.input_names:
            status = self._put(*self._put_arguments)
        if self.input_flag_names and status <= _WARNING:
            status = self._put_flags(*self._put_flag_arguments)
        if status > _WARNING:
            raise self._failure("set the inputs", status)

    def _set(self, name: str, value: Value) -> None:
        """Set a start value by the type that the FMU declares."""
        variable = self.description.variables[name]
        kind = KINDS.get(variable.type)
        names = {"Real": "Float64", "Integer": "Int32"} if self.description.major == 3 else {}
        if kind is None:
            raise FmuError(f"{name}: start values of type {variable.type} are not supported")
        convert: Any = {"Real": float, "Boolean": bool, "String": str, "Integer": int}[kind]
        setter = getattr(self._fmu, f"set{names.get(kind, kind)}")
        try:
            setter([variable.valueReference], [convert(value)])
        except Exception as error:
            raise self._failure(f"set {name} = {value!r}", error) from None

    def _failure(self, what: str, cause: Exception | int) -> FmuError:
        if self.messages:
            words = self.messages[-1]
        elif isinstance(cause, Exception):
            words = _first_line(cause)
        else:
            words = f"status {_STATUS[cause] if 0 <= cause < len(_STATUS) else cause}, no message"
        return FmuError(f"{self.description.path.name}: could not {what}: {words}")


def _plain(message: bytes) -> str:
    """A message without the standard's escape of "#", which marks a value reference."""
    return message.decode("utf-8", "replace").replace("##", "#")


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]
