"""One face for an instance of FMI 2.0 or FMI 3.0: each test of the ceremony runs on both."""

import contextlib
import ctypes
import os
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

import fmpy
import pytest
from fmpy import fmi2, fmi3
from fmpy.fmi1 import FMICallException

ROOT = Path(__file__).resolve().parent.parent
FIXTURE = ROOT / "tests" / "fmu_fixture"
sys.path.insert(0, str(ROOT / "fmu"))  # fmu/ is a folder of scripts, not a package
build, describe, generate, package, reference, toolchain, variables = map(
    import_module,
    ("build", "describe", "generate", "package", "reference", "toolchain", "variables"),
)

OK, WARNING, ERROR = 0, 1, 3
H = 0.1


class Face:
    """An instance, its messages, its variables by name; a refused call raises FMICallException."""

    def __init__(
        self,
        folder: Path,
        *,
        token: str | None = None,
        name: str = "face",
        logger: bool = True,
        logging: bool = True,
    ) -> None:
        self.description = fmpy.read_model_description(str(folder))
        self.variables = {v.name: v for v in self.description.modelVariables}
        self.version = int(self.description.fmiVersion[0])
        self.messages: list[tuple[int, str, str]] = []
        slave = fmi2.FMU2Slave if self.version == 2 else fmi3.FMU3Slave
        self.fmu = slave(
            guid=token or self.description.guid,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            unzipDirectory=str(folder),
            instanceName=name,
        )
        self._instantiate(logger, logging)

    def _instantiate(self, logger: bool, logging: bool) -> None:
        if self.version == 2:
            self.callbacks = fmi2.fmi2CallbackFunctions()
            if logger:
                self.callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(
                    lambda _env, _name, *message: self._log(*message)
                )
            self.fmu.instantiate(callbacks=self.callbacks, loggingOn=logging)
        elif logger:
            self.fmu.instantiate(logMessage=lambda _env, *m: self._log(*m), loggingOn=logging)
        else:
            resources = os.path.join(self.fmu.unzipDirectory, "resources", "")  # noqa: PTH118
            arguments = [b"face", self.fmu.guid.encode(), resources.encode()]
            self.fmu.component = self.fmu.fmi3InstantiateCoSimulation(
                *arguments, False, True, False, False, None, 0, None,
                fmi3.fmi3LogMessageCallback(), fmi3.fmi3IntermediateUpdateCallback(),
            )  # fmt: skip

    def _log(self, status: int, category: bytes, message: bytes) -> None:
        self.messages.append((status, category.decode(), message.decode()))

    @property
    def last(self) -> str:
        """The last message."""
        return self.messages[-1][2]

    def initialise(self, stop: float | None = None, **start: Any) -> "Face":
        """From instantiated to ready for steps, through `enter`."""
        self.enter(stop)
        for name, value in start.items():
            self[name.replace("_", ".")] = value
        self.fmu.exitInitializationMode()
        return self

    def enter(self, stop: float | None = None) -> None:
        """Into initialization mode."""
        if self.version == 2:
            self.fmu.setupExperiment(startTime=0.0, stopTime=stop)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=0.0, stopTime=stop)

    def __setitem__(self, name: str, value: Any) -> None:
        variable = self.variables[name]
        setter = {"Real": "setReal"}.get(variable.type, f"set{variable.type}")
        getattr(self.fmu, setter)([variable.valueReference], [value])

    def __getitem__(self, name: str) -> Any:
        variable = self.variables[name]
        value = getattr(self.fmu, f"get{variable.type}")([variable.valueReference])[0]
        if variable.type == "Boolean":
            return bool(value)
        return value.decode() if isinstance(value, bytes) else value

    def call(self, name: str, *arguments: Any) -> int:
        """The status of an entry point, named as in FMI 2.0, called without FMPy's own checks."""
        if self.version == 3:
            name = name.replace("FMUstate", "FMUState").replace("DeSerialize", "Deserialize")
        entry = ctypes.cast(getattr(self.fmu.dll, f"fmi{self.version}{name}"), ctypes.c_void_p)
        function = ctypes.CFUNCTYPE(ctypes.c_int)(entry.value or 0)
        return int(function(ctypes.c_void_p(self.fmu.component), *arguments))

    def refusal(self, name: str, *arguments: Any) -> str:
        """The message of an entry point that must answer Error."""
        before = len(self.messages)
        assert self.call(name, *arguments) == ERROR
        status, category, message = self.messages[before]
        assert (status, category, len(self.messages)) == (ERROR, "logStatusError", before + 1)
        return message

    def sized(self, references: Any, n: int, values: Any) -> tuple[Any, ...]:
        """Arguments of a getter or setter; FMI 3.0 repeats the number of values."""
        size = ctypes.c_size_t(n)
        return (references, size, values, *([size] if self.version == 3 else []))

    def set_status(self, name: str, value: float) -> int:
        """Set a real variable; returns the status."""
        reference = (ctypes.c_uint * 1)(self.variables[name].valueReference)
        setter = "SetReal" if self.version == 2 else "SetFloat64"
        return self.call(setter, *self.sized(reference, 1, (ctypes.c_double * 1)(value)))

    def step(self, k: int, h: float = H) -> None:
        """The step from k * h to (k + 1) * h."""
        self.fmu.doStep(k * h, h)

    def run(self, first: int, last: int, u: float = 1.0) -> list[tuple[float, ...]]:
        """Steps first to last - 1 under an input that changes each step; the outputs after each."""
        rows = []
        for k in range(first, last):
            self["In.u"] = u * (1.0 + 0.1 * k)
            self.step(k)
            rows.append(tuple(self[f"Out.{corner}"] for corner in ("FL", "FR", "RL", "RR")))
        return rows

    def serialize(self) -> bytes:
        """The present state as bytes."""
        state = self.fmu.getFMUState()
        data: bytes = self.fmu.serializeFMUState(state)
        self.fmu.freeFMUState(state)
        return data

    def restore(self, data: bytes) -> None:
        """Go on from serialised bytes."""
        read = "deSerializeFMUstate" if self.version == 2 else "deserializeFMUState"
        state = getattr(self.fmu, read)(data)
        self.fmu.setFMUState(state)
        self.fmu.freeFMUState(state)

    def free(self) -> None:
        """Free the instance and the library."""
        self.fmu.freeInstance()


FaceT = TypeVar("FaceT", bound=Face)


@contextlib.contextmanager
def instances(kind: Callable[..., FaceT], *arguments: object) -> Iterator[Callable[..., FaceT]]:
    """What makes instances of one kind from these arguments; they are freed at the end."""
    with contextlib.ExitStack() as stack:

        def new(**options: object) -> FaceT:
            face = kind(*arguments, **options)
            stack.callback(face.free)
            return face

        yield new


def refused(face: Face, call: Callable[[], object]) -> str:
    """The message of a call that must answer Error."""
    with pytest.raises(FMICallException) as caught:
        call()
    assert caught.value.status == ERROR
    assert face.messages[-1][:2] == (ERROR, "logStatusError")
    return face.last
