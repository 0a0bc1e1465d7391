"""A run whose process died: what it has recorded is brought to its folder, and its end told."""

from __future__ import annotations

from pathlib import Path

from cosim import black_box
from cosim.batch.job import Run, RunEnd
from cosim.errors import InputError
from cosim.isolation import Death
from cosim.recorder import Format, Recorder
from cosim.results import folder_of
from cosim.scenario.schema import Scenario


def buried(run: Run, death: Death) -> RunEnd:
    """Write what a run has recorded until its process died, and return how it ended."""
    name = f"the run {run.label}" if len(run.checked.labels) > 1 else "the run"
    last_s, words = _brought_home(name, death, run.folder, run.checked.file_format)
    return RunEnd(run.label, exit_code=3, problems=(words,), death=death, last_s=last_s)


def bury_run_under_way(scenario: Scenario, output_dir: Path, death: Death) -> str:
    """Write what was recorded of the run of a scenario that took its process with it, the first
    one without results; return how it ended in a sentence.
    """
    folders = {c.label: folder_of(scenario, output_dir, c.label) for c in scenario.controllers}
    file_format = scenario.output.format
    for label, folder in folders.items():
        has_box = (folder / black_box.NAME).exists()
        if has_box or not (folder / f"signals.{file_format}").exists():
            name = f"the run {label}" if len(folders) > 1 else "the run"
            return _brought_home(name, death, folder, file_format)[1]
    return f"the run {death.manner}{death.where}, after its end{death.said}"


def _brought_home(
    name: str, death: Death, folder: Path, file_format: Format
) -> tuple[float | None, str]:
    box = folder / black_box.NAME
    record, unread = None, ""
    try:
        record = Recorder.recovered(box)
        box.unlink()
    except FileNotFoundError:
        pass
    except (InputError, OSError) as error:
        unread = f"; its record cannot be read: {error}"
    last_s, words = farewell(name, death, record, folder, file_format)
    return last_s, words + unread


def farewell(
    name: str, death: Death, record: Recorder | None, folder: Path, file_format: Format
) -> tuple[float | None, str]:
    """Write the record of a run that died; return the time of its last sample [s], None if it has
    none, and how the run ended in a sentence.
    """
    last_s, wrote = None, ""
    if record is not None and record.rows:
        last_s = float(record.time[-1])
        try:
            wrote = f"; {_until(record.rows, record.write(folder, file_format))}"
        except (InputError, OSError) as error:
            wrote = f"; its record cannot be written: {error}"
    when = f"after the sample at t = {last_s:.6g} s" if last_s is not None else "before its start"
    return last_s, f"{name} {death.manner}{death.where} {when}{death.said}{wrote}"


def _until(rows: int, file: Path) -> str:
    return f"the {rows} samples until then are in {file}" if rows > 1 else f"it is in {file}"
