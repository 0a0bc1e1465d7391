"""A single run in this process that stands still is ended with a sentence and its record.

A call into an FMU that does not return can be neither waited for nor interrupted: Python hears of
Ctrl-C only after it. A thread beside it can still write what was recorded and end the process.
(Crashes are `cosim.guardian`'s. Runs of a batch have processes of their own, and are watched from
outside: `cosim.batch`.)
"""

from __future__ import annotations

import os
import signal
import socket
import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import click

from cosim import black_box
from cosim.exit_codes import INTERRUPTED
from cosim.isolation import Death

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from cosim.recorder import Recorder
    from cosim.run import Assembly, RunResult
    from cosim.scenario.controllers import Controller
    from cosim.scenario.schema import Scenario

_LOOK: Final = 0.25  # s between two looks
_GRACE: Final = 2.0  # s that Python may take to hear of Ctrl-C
_FAILED: Final = 3


class Watchdog:
    """Ends this process when a run has no new sample for `timeout` [s], beside the time that it may
    wait for a sensor on a bus, or none after Ctrl-C.

    A context manager around the runs, in the main thread; `output_dir` is where their results go,
    `ending` is called before the process is ended. The rows of the run under way lie in a file
    there, for whoever outlives this process.
    """

    def __init__(
        self, timeout: float, output_dir: Path, ending: Callable[[], None] = lambda: None
    ) -> None:
        self._timeout, self._output_dir, self._ending = timeout, output_dir, ending
        self._box: Path | None = None
        self._ears, self._mouth = socket.socketpair()
        self._under_way: WatchedAssembly | None = None
        self._hears = threading.current_thread() is threading.main_thread()
        self._main = threading.get_ident()
        self._before = -1

    def __enter__(self) -> Watchdog:
        self._ears.settimeout(_LOOK)
        self._mouth.setblocking(False)
        if self._hears:
            self._before = signal.set_wakeup_fd(self._mouth.fileno(), warn_on_full_buffer=False)
        threading.Thread(target=self._watch, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._hears:
            signal.set_wakeup_fd(self._before)
        self._mouth.close()  # which ends the thread
        self._unbox()

    def assemble(self, scenario: Scenario, controller: Controller) -> WatchedAssembly:
        """Connect the blocks of a run, as `cosim.assembly.assemble` does, and watch over it."""
        from cosim.assembly import assemble
        from cosim.results import folder_of

        self._unbox()  # the run before has its signals
        folder = folder_of(scenario, self._output_dir, controller.label)
        name = f"the run {controller.label}" if len(scenario.controllers) > 1 else "the run"
        inner = assemble(scenario, controller)
        if os.name == "posix":  # where a file that is mapped can be taken away
            self._box = folder / black_box.NAME
            inner.recorder.keep_in(self._box)
        bus = controller.sensor_of_run(scenario.sensor).bus
        connect_s = 0.0 if bus is None else bus.connect_s
        return WatchedAssembly(inner, name, folder, scenario.output.format, self._over, connect_s)

    def _unbox(self) -> None:
        if self._box is not None:
            self._box.unlink(missing_ok=True)

    def _over(self, run: WatchedAssembly | None) -> None:
        self._under_way = run

    def _watch(self) -> None:
        """Look at the run until the context ends. Looks are counted, not the clock's time: a
        process that was stopped meanwhile has not hung.
        """
        looks, last, interrupted = 0, None, False
        while True:
            try:
                heard = self._ears.recv(64)
                if not heard:
                    break
                if signal.SIGINT in heard:
                    interrupted, looks = True, 0
                continue
            except TimeoutError:
                looks += 1
            run = self._under_way
            now = (run, run.recorder.rows) if run is not None else None
            if now != last or run is None:
                last, looks = now, 0
            elif interrupted and looks * _LOOK >= _GRACE:
                self._end(run, "interrupted", INTERRUPTED)
            elif looks * _LOOK >= self._timeout + (run.connect_s if not run.recorder.rows else 0.0):
                self._end(run, "hang", _FAILED)
        self._ears.close()

    def _end(self, run: WatchedAssembly, kind: Literal["hang", "interrupted"], code: int) -> None:
        """Write what was recorded, say so and end the process."""
        from cosim.batch.buried import farewell

        death = Death(kind, stack=_stack(self._main), timeout=self._timeout)
        try:
            _, words = farewell(run.name, death, run.recorder, run.folder, run.file_format)
            show_cursor = "\x1b[?25h\n" if sys.stderr.isatty() else ""
            click.echo(f"{show_cursor}error: {words}", err=True)
            run.let_go()
            self._unbox()
            self._ending()
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(code)


@dataclass(frozen=True, eq=False)
class WatchedAssembly:
    """The blocks of one run that tell when it begins and ends; `connect_s` is how long it may wait
    for its sensor [s] before its first sample.
    """

    inner: Assembly
    name: str
    folder: Path
    file_format: Literal["csv", "parquet"]
    over: Callable[[WatchedAssembly | None], None]
    connect_s: float = 0.0

    @property
    def recorder(self) -> Recorder:
        """The record that the run fills."""
        return self.inner.recorder

    @property
    def initial_command(self) -> npt.NDArray[np.float64]:
        """Damper commands before the first sample, (4,)."""
        return self.inner.initial_command

    @property
    def files(self) -> Mapping[str, Path]:
        """Files that decide the result."""
        return self.inner.files

    def run(self, progress: Callable[[int, int], None] | None) -> RunResult:
        """Run to the end."""
        self.over(self)
        try:
            return self.inner.run(progress)
        finally:
            self.over(None)

    def let_go(self) -> None:
        """End the sensor's own process, if the run has started one."""
        bus: Any = getattr(self.inner, "bus", None)
        if bus is not None:
            bus.close()


def _stack(thread: int) -> str:
    """Return the frames of a thread as the interpreter writes them at a crash, innermost first."""
    frames = traceback.extract_stack(sys._current_frames()[thread])
    return "\n".join(f'File "{f.filename}", line {f.lineno} in {f.name}' for f in reversed(frames))
