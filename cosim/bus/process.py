"""The sensor's process where a run starts and ends it itself."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Sequence
from typing import Final

STOP_S: Final = 5.0
IDLE_S: Final = 60.0  # a node whose bench has died ends by itself


class NodeProcess:
    """`cosim sensor-node` with `arguments`, for one run."""

    def __init__(self, arguments: Sequence[str]) -> None:
        self._command = [
            *(sys.executable, "-m", "cosim", "sensor-node", *arguments),
            *("--runs", "1", "--idle", f"{IDLE_S:g}"),
        ]
        self._process: subprocess.Popen[str] | None = None

    def start(self) -> None:
        """Start it; it takes a second or two until it listens."""
        self._process = subprocess.Popen(
            self._command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )

    def last_words(self) -> str | None:
        """Return what it said last if it has ended, None while it runs."""
        process = self._process
        if process is None or process.poll() is None or process.stderr is None:
            return None
        if process.returncode < 0:
            return f"signal {-process.returncode} ({signal.strsignal(-process.returncode)})"
        lines = process.stderr.read().strip().splitlines()
        return lines[-1].removeprefix("error: ") if lines else f"exit code {process.returncode}"

    def stop(self, ending: bool) -> None:
        """End it, by force where it is not `ending` by itself or takes too long for it."""
        process, self._process = self._process, None
        if process is None:
            return
        if not ending:
            process.terminate()
        for harder in (process.terminate, process.kill, process.kill):
            try:
                process.communicate(timeout=STOP_S)
            except subprocess.TimeoutExpired:
                harder()
            else:
                return
