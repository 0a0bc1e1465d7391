"""One instance of an FMU under trial: its life, values, states and steps, of either FMI version."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

from cosim.check.trials.job import Channel
from cosim.check.trials.library import OK, WARNING, Library, Refused

_POINTER, _SIZE, _DOUBLE = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double


class Instance:
    """Calls that raise `Refused` unless they answer OK or Warning; `try_` returns the status."""

    def __init__(self, library: Library, token: str | None = None) -> None:
        self.library = library
        library.messages.clear()
        address = library.instantiate(library.job.token if token is None else token)
        if not address:
            name = "Instantiate" if library.major == 2 else "InstantiateCoSimulation"
            raise Refused(library.full_name(name), 3, self.words())
        self._address: Any = _POINTER(address)
        self.ended = False  # the FMU asks for an end of the simulation
        self.last_time: float | None = None

    def words(self) -> str:
        """Return the FMU's last message of a warning or worse, else its last one."""
        said = self.library.messages
        serious = [text for status, _, text in said if status not in (OK,)]
        return (serious or [text for _, _, text in said] or [""])[-1].strip()

    def try_(self, function: str, *arguments: Any, note: str = "") -> int:
        """Call a function of this instance; return its status."""
        status = self.library.call(function, ctypes.c_int, self._address, *arguments, note=note)
        return int(status)

    def do(self, function: str, *arguments: Any, note: str = "") -> None:
        """Call a function of this instance; raise `Refused` unless it goes on."""
        self.library.messages.clear()
        status = self.try_(function, *arguments, note=note)
        if status > WARNING:
            raise Refused(self.library.full_name(function), status, self.words())

    # ------------------------------------------------------------ life

    def enter(self, stop: float | None = None) -> None:
        """Set the experiment up and enter initialization mode."""
        start = self.library.job.start
        times = (_DOUBLE(start), self._flag(stop is not None), _DOUBLE(stop or 0.0))
        if self.library.major == 2:
            self.do("SetupExperiment", self._flag(False), _DOUBLE(0.0), *times)
            self.do("EnterInitializationMode")
        else:
            self.do("EnterInitializationMode", self._flag(False), _DOUBLE(0.0), *times)

    def initialise(self, stop: float | None = None) -> None:
        """From instantiated to ready for steps."""
        self.enter(stop)
        self.do("ExitInitializationMode")

    def step(self, t: float, h: float) -> None:
        """Advance from t by h [s]; sets `ended` and, in FMI 3, `last_time`."""
        self.library.messages.clear()
        status = self.try_step(t, h)
        if status > WARNING:
            raise Refused(self.library.full_name("DoStep"), status, self.words())

    def try_step(self, t: float, h: float, when: str = "") -> int:
        """Like `step`, but returns the status."""
        arguments: list[Any] = [_DOUBLE(t), _DOUBLE(h), self._flag(False)]
        answers = (ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool(), _DOUBLE())
        if self.library.major == 3:
            arguments += [ctypes.byref(answer) for answer in answers]
        status = self.try_("DoStep", *arguments, note=when or f" at t = {t:.6g} s")
        if self.library.major == 3 and status <= WARNING:
            self.ended, self.last_time = bool(answers[1].value), float(answers[3].value)
        return status

    def free(self) -> None:
        """Free the instance."""
        self.library.call("FreeInstance", None, self._address)

    def _flag(self, value: bool) -> Any:
        return ctypes.c_int(value) if self.library.major == 2 else ctypes.c_bool(value)

    # ------------------------------------------------------------ values

    def get(self, channel: Channel) -> list[Any]:
        """Return the values of a variable, one to an element."""
        kind, array = self.library.values(channel)
        self.do(f"Get{kind}", *self._reference(channel, array), note=f" of {channel.name}")
        return [v.decode("utf-8", "replace") if isinstance(v, bytes) else v for v in array]

    def set(self, channel: Channel, values: Sequence[Any]) -> None:
        """Set a variable."""
        kind, array = self.library.values(channel, list(values))
        self.do(f"Set{kind}", *self._reference(channel, array), note=f" of {channel.name}")

    def _reference(self, channel: Channel, array: Any) -> list[Any]:
        references = (ctypes.c_uint32 * 1)(channel.reference)
        arguments: list[Any] = [references, _SIZE(1), array]
        return arguments if self.library.major == 2 else [*arguments, _SIZE(len(array))]

    # ------------------------------------------------------------ states

    def get_state(self) -> Any:
        """Return a saved state."""
        state = _POINTER()
        self.do("GetFMUState", ctypes.byref(state))
        return state

    def set_state(self, state: Any) -> None:
        """Go back to a saved state."""
        self.do("SetFMUState", state)

    def free_state(self, state: Any) -> None:
        """Free a saved state."""
        self.do("FreeFMUState", ctypes.byref(state))

    def serialise(self, state: Any) -> bytes:
        """Return a saved state as bytes."""
        size = _SIZE()
        self.do("SerializedFMUStateSize", state, ctypes.byref(size))
        content = (ctypes.c_char * size.value)()
        self.do("SerializeFMUState", state, content, size)
        return bytes(content.raw)

    def deserialise(self, content: bytes) -> Any:
        """Return the saved state that bytes stand for."""
        state = _POINTER()
        array = (ctypes.c_char * len(content)).from_buffer_copy(content)
        self.do("DeserializeFMUState", array, _SIZE(len(content)), ctypes.byref(state))
        return state
