"""A run whose process died: what it has recorded is brought to its folder, and its end told."""

from __future__ import annotations

from pathlib import Path

from cosim import black_box
from cosim.batch.job import Run, RunEnd
from cosim.errors import InputError
from cosim.isolation import Death
from cosim.recorder import Recorder


def buried(run: Run, death: Death) -> RunEnd:
    """Write what a run has recorded until its process died, and return how it ended."""
    last_s, wrote = None, ""
    box = run.folder / black_box.NAME
    try:
        record = Recorder.recovered(box)
        box.unlink()
        if record.rows:
            last_s = float(record.time[-1])
            wrote = f"; {_until(record.rows, record.write(run.folder, run.checked.file_format))}"
    except FileNotFoundError:
        pass
    except (InputError, OSError) as error:
        wrote = f"; its record cannot be written: {error}"
    when = f"after the sample at t = {last_s:.6g} s" if last_s is not None else "before its start"
    where = f" in {death.frame}" if death.frame else ""
    name = f"the run {run.label}" if len(run.checked.labels) > 1 else "the run"
    words = f"{name} {death.manner}{where} {when}{death.said}{wrote}"
    return RunEnd(run.label, exit_code=3, problems=(words,), death=death, last_s=last_s)


def _until(rows: int, file: Path) -> str:
    return f"the {rows} samples until then are in {file}" if rows > 1 else f"it is in {file}"
