"""The functions of an FMU's shared library, FMI 2.0 and FMI 3.0, called by one set of names.

Signatures follow fmi2FunctionTypes.h and fmi3FunctionTypes.h. Every call is noted in the journal
before it is made.
"""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path
from typing import Any, Final

from cosim.check.trials.job import Channel, Job
from cosim.isolation.journal import Journal

OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)
STATUS: Final = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")

C_TYPES: Final[dict[str, Any]] = {
    "Float64": ctypes.c_double, "Float32": ctypes.c_float, "Int8": ctypes.c_int8,
    "UInt8": ctypes.c_uint8, "Int16": ctypes.c_int16, "UInt16": ctypes.c_uint16,
    "Int32": ctypes.c_int32, "UInt32": ctypes.c_uint32, "Int64": ctypes.c_int64,
    "UInt64": ctypes.c_uint64, "Boolean": ctypes.c_bool, "String": ctypes.c_char_p,
}  # fmt: skip
C_TYPES2: Final[dict[str, Any]] = {
    "Real": ctypes.c_double, "Integer": ctypes.c_int, "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}  # fmt: skip
_POINTER, _SIZE, _DOUBLE, _TEXT = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double, ctypes.c_char_p
_LOGGER2 = ctypes.CFUNCTYPE(None, _POINTER, _TEXT, ctypes.c_int, _TEXT, _TEXT)
_LOGGER3 = ctypes.CFUNCTYPE(None, _POINTER, ctypes.c_int, _TEXT, _TEXT)


class _Callbacks(ctypes.Structure):
    _fields_ = (
        ("logger", _LOGGER2), ("allocate", _POINTER), ("free", _POINTER),
        ("step_finished", _POINTER), ("environment", _POINTER),
    )  # fmt: skip


class Refused(Exception):  # noqa: N818 - an answer of the FMU, not a mistake
    """A call answered worse than Warning."""

    def __init__(self, function: str, status: int, words: str) -> None:
        self.function, self.status, self.words = function, status, words
        super().__init__(f"{function} answered {status_name(status)}" + (words and f": {words}"))


class Missing(Exception):  # noqa: N818
    """The library does not export a function."""


def status_name(status: int) -> str:
    """Return the name of a status."""
    return STATUS[status] if 0 <= status < len(STATUS) else f"the status {status}"


class Library:
    """A loaded shared library. Raises `OSError` with the loader's words."""

    def __init__(self, job: Job, journal: Journal) -> None:
        self.job, self.major, self.journal = job, job.major, journal
        self.messages: list[tuple[int, str, str]] = []
        self.categories: set[str] = set()
        self.journal.call("the loading of the library")
        folder = str(Path(job.library).parent)
        if sys.platform == "win32":
            os.add_dll_directory(folder)
        self._library = ctypes.CDLL(job.library)
        self._logger: Any = (_LOGGER2 if job.major == 2 else _LOGGER3)(
            self._log2 if job.major == 2 else self._log3
        )
        self.callbacks = self._callbacks()

    def has(self, *functions: str) -> bool:
        """Whether the library exports functions, by FMI 3's names without prefix."""
        return all(hasattr(self._library, self.full_name(name)) for name in functions)

    def full_name(self, function: str) -> str:
        """Return the full name of a function in this FMI version."""
        if self.major == 2:
            function = {
                "DeserializeFMUState": "DeSerializeFMUstate", "GetFMUState": "GetFMUstate",
                "SetFMUState": "SetFMUstate", "FreeFMUState": "FreeFMUstate",
                "SerializeFMUState": "SerializeFMUstate",
                "SerializedFMUStateSize": "SerializedFMUstateSize",
            }.get(function, function)  # fmt: skip
        return f"fmi{self.major}{function}"

    def call(self, function: str, result: Any, *arguments: Any, note: str = "") -> Any:
        """Call a function; `arguments` are ctypes values, `note` says more of it in the journal."""
        name = self.full_name(function)
        self.journal.call(f"{name}{note}")
        entry = getattr(self._library, name, None)
        if entry is None:
            raise Missing(name)
        entry.restype = result
        return entry(*arguments)

    def instantiate(self, token: str) -> Any:
        """Return a new instance, None if the FMU refuses."""
        name, wanted = b"checked", token.encode()
        if self.major == 2:
            location = Path(self.job.resources).as_uri().encode()
            return self.call(
                "Instantiate", _POINTER, _TEXT(name), ctypes.c_int(1), _TEXT(wanted),
                _TEXT(location), ctypes.byref(self.callbacks), ctypes.c_int(0), ctypes.c_int(1),
            )  # fmt: skip
        yes, no = ctypes.c_bool(True), ctypes.c_bool(False)
        return self.call(
            "InstantiateCoSimulation", _POINTER, _TEXT(name), _TEXT(wanted),
            _TEXT(os.path.join(self.job.resources, "").encode()), no, yes, no, no,  # noqa: PTH118
            _POINTER(None), _SIZE(0), _POINTER(None), self._logger, _POINTER(None),
        )  # fmt: skip

    def values(self, channel: Channel, content: list[Any] | None = None) -> tuple[str, Any]:
        """Return the suffix of get and set for a channel, and an array for its values."""
        kind = channel.type
        if kind == "Enumeration":
            kind = "Integer" if self.major == 2 else "Int64"
        c_type = (C_TYPES2 if self.major == 2 else C_TYPES)[kind]
        array = (c_type * channel.size)()
        if content is not None:
            encoded = [v.encode() if isinstance(v, str) else v for v in content]
            array[:] = encoded
        return kind, array

    def _log2(self, _env: Any, _name: bytes, status: int, category: bytes, text: bytes) -> None:
        self._note(status, category, text)

    def _log3(self, _env: Any, status: int, category: bytes, text: bytes) -> None:
        self._note(status, category, text)

    def _note(self, status: int, category: bytes | None, text: bytes | None) -> None:
        message = (text or b"").decode("utf-8", "replace")
        name = (category or b"").decode("utf-8", "replace")
        self.categories.add(name)
        self.messages.append((status, name, message))
        self.journal.message(message)

    def _callbacks(self) -> _Callbacks:
        """FMPy has a proxy that formats the variadic messages of FMI 2.0."""
        system = ctypes.CDLL("msvcrt") if sys.platform == "win32" else ctypes.CDLL(None)
        callbacks = _Callbacks(
            self._logger if self.major == 2 else _LOGGER2(),
            ctypes.cast(system.calloc, _POINTER).value,
            ctypes.cast(system.free, _POINTER).value,
        )
        if self.job.logger and self.major == 2:
            self._proxy = ctypes.CDLL(self.job.logger)
            self._proxy.addLoggerProxy(ctypes.byref(callbacks))
        return callbacks
