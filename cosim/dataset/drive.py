"""Driving one run of a data set, and writing it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from cosim.dataset.plan import COMMAND, PlannedRun
from cosim.dataset.sensorless import NoSensor
from cosim.errors import InputError
from sensor.channels import CHANNEL_NAMES, ROAD, STAGE

if TYPE_CHECKING:
    from cosim.assembly import Assembly
    from cosim.loop import ControllerBlock
    from cosim.recorder import Recorder
    from sensor.dataset import Run

Array = npt.NDArray[np.float64]
ENDING: Final = ".parquet"


def is_there(planned: PlannedRun, directory: Path) -> bool:
    """Whether the run's whole file is there, driven from the same values, scenario and FMU."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = directory / f"{planned.stem}{ENDING}"
    if not path.is_file():
        return False
    try:
        metadata = pq.read_schema(path).metadata or {}
    except (pa.ArrowInvalid, OSError):
        return False
    return bool(json.loads(metadata.get(b"recipe", b"{}")) == recipe_of(planned))


def recipe_of(planned: PlannedRun) -> dict[str, Any]:
    """Return what a run is driven from, for its file's metadata."""
    from cosim.provenance import sha256

    return {
        "scenario": planned.scenario.name,
        "dampers": planned.dampers,
        "seed": planned.seed,
        "fields": {".".join(map(str, o.key)): o.value for o in planned.overrides},
        "drawn": dict(planned.drawn),
        "scenario_sha256": sha256(planned.scenario),
        "fmu_sha256": _fmu_sha256(),
    }


@cache
def _fmu_sha256() -> str:
    from cosim.provenance import sha256
    from cosim.vehicle import builtin_fmu

    return sha256(builtin_fmu())


def drive(planned: PlannedRun, directory: Path) -> float:
    """Drive a run without a sensor, write it, and return the simulated time [s].

    Raises `InputError` where the car did not come to the end of what the scenario asks for.
    """
    from sensor.dataset import write_run

    with TemporaryDirectory() as roads:  # a road is made of the run's own seed: nobody else's
        assembly = _assembled(planned, Path(roads))
        result = assembly.run(None)
    if result.lap_time_s is None and result.finish_reason != "duration reached":
        sentence = f"after {result.simulated_s:.1f} s: {result.finish_reason}"
        raise InputError(f"{planned.scenario}: {sentence}, so it is no training run")
    recorder, initial = assembly.recorder, assembly.initial_command
    run = run_of(recorder, initial, planned.stem, recipe_of(planned))
    part = directory / f".{planned.stem}.part"
    write_run(part, run)
    part.replace(directory / f"{planned.stem}{ENDING}")
    return result.simulated_s


def _assembled(planned: PlannedRun, roads: Path) -> Assembly:
    """Return the run's blocks with the kind of dampers that it asks for."""
    from cosim.assembly import assemble
    from cosim.scenario.controllers import Passive, Skyhook
    from cosim.scenario.load import load_with

    scenario = load_with(planned.scenario, planned.overrides)
    if planned.dampers == "skyhook":
        skyhook = Skyhook(kind="skyhook", feedback="truth")
        return assemble(scenario, skyhook, NoSensor(), roads=roads)
    return assemble(scenario, Passive(kind="passive"), NoSensor(), _dampers(planned), roads)


def _dampers(planned: PlannedRun) -> ControllerBlock | None:
    from cosim.assembly import STEP_S
    from cosim.control.fixed import FixedDampers
    from cosim.control.switching import SwitchingDampers

    if planned.dampers == "switching":
        return SwitchingDampers(planned.seed, STEP_S)
    return FixedDampers(planned.drawn[COMMAND]) if planned.dampers == "fixed" else None


def run_of(recorder: Recorder, initial: Array, name: str, recipe: Mapping[str, Any]) -> Run:
    """Return what was recorded as a run of a data set, its channels before any error and fault;
    `initial` (4,) is the damper command before the first sample.
    """
    from cosim.recorder import held
    from sensor.dataset import Run

    recorded = {
        "channels": recorder.car_channels(CHANNEL_NAMES),
        "stage": recorder.columns([channel.name for channel in STAGE]),
        "commands": held(recorder.group("command"), initial),
        "truth": recorder.group("truth"),
        "road": recorder.columns([channel.name for channel in ROAD]),
    }
    parts = {group: values.astype(np.float32) for group, values in recorded.items()}
    return Run(name=name, recipe=recipe, **parts)
