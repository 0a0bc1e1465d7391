"""Data sets for training: laps driven by the loop itself, one Parquet file per run."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cosim.errors import InputError
from cosim.scenario.surface import SurfaceName
from sensor.channels import ROAD, STAGE

if TYPE_CHECKING:
    from cosim.recorder import Recorder
    from sensor.dataset import Run

Array = npt.NDArray[np.float64]
Dampers = Literal["passive", "switching"]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Selection(_Part):
    """Scenario files by a glob pattern relative to the recipe, each driven once per surface (its
    own if none is named) and kind of dampers.
    """

    scenarios: str = Field(min_length=1)
    surfaces: tuple[SurfaceName, ...] = ()
    dampers: tuple[Dampers, ...] = Field(min_length=1)


class DatasetRecipe(_Part):
    """Which runs make a data set; run i has the seed 1000 * `seed` + i for surface and dampers."""

    name: str
    seed: int = Field(ge=0)
    runs: tuple[Selection, ...] = Field(min_length=1)


@dataclass(frozen=True)
class PlannedRun:
    """One run: its scenario file, dampers, seed and surface, which is the scenario's own if None;
    `stem` names its file.
    """

    scenario: Path
    dampers: Dampers
    seed: int
    surface: SurfaceName | None = None

    @property
    def stem(self) -> str:
        """File name without ending, `<scenario>[_<surface>]_<dampers>`."""
        surface = self.surface or ""
        road = f"class_{surface.lower()}" if len(surface) == 1 else surface
        return "_".join(part for part in (self.scenario.stem, road, self.dampers) if part)

    @property
    def overrides(self) -> list[str]:
        """What is laid over the scenario."""
        surface = [] if self.surface is None else [f"road.surface={self.surface}"]
        return [f"seed={self.seed}", *surface]


def load_recipe(path: Path) -> DatasetRecipe:
    """Read a recipe; raises `InputError` naming the file and everything wrong in it."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return DatasetRecipe.model_validate(YAML(typ="safe").load(path.read_text("utf-8")))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not UTF-8 text") from None
    except YAMLError as error:
        raise InputError(f"{path}: {' '.join(str(error).split())}") from None
    except ValidationError as error:
        sentences = [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors()]
        raise InputError(f"{path}: " + "; ".join(sentences)) from None


def plan(recipe: DatasetRecipe, folder: Path) -> list[PlannedRun]:
    """Return the runs in a fixed order; raises `InputError` for a pattern that matches nothing."""
    chosen: list[tuple[Path, SurfaceName | None, Dampers]] = []
    for selection in recipe.runs:
        files = sorted(folder.glob(selection.scenarios))
        if not files:
            raise InputError(f"no scenario in {folder} matches '{selection.scenarios}'")
        chosen += itertools.product(files, selection.surfaces or (None,), selection.dampers)
    runs = [
        PlannedRun(file, dampers, 1000 * recipe.seed + i, surface)
        for i, (file, surface, dampers) in enumerate(chosen)
    ]
    stems = [run.stem for run in runs]
    doubled = sorted({stem for stem in stems if stems.count(stem) > 1})
    if doubled:
        raise InputError(f"runs chosen more than once: {', '.join(doubled)}")
    return runs


def build(
    runs: list[PlannedRun],
    directory: Path,
    executor: Executor,
    progress: Callable[[str], None] = lambda stem: None,
) -> None:
    """Drive every run that is not in `directory` yet, or there from another FMU or scenario."""
    directory.mkdir(parents=True, exist_ok=True)
    missing = [run for run in runs if not _is_there(run, directory)]
    for stem in executor.map(drive, missing, [directory] * len(missing)):
        progress(stem)


def _is_there(planned: PlannedRun, directory: Path) -> bool:
    """Whether the run's file is there, driven from the same scenario, seed and vehicle FMU."""
    import json

    import pyarrow as pa
    import pyarrow.parquet as pq

    path = directory / f"{planned.stem}.parquet"
    if not path.is_file():
        return False
    try:
        metadata = pq.read_schema(path).metadata or {}
    except pa.ArrowInvalid:
        return False
    return bool(json.loads(metadata.get(b"recipe", b"{}")) == _recipe(planned))


def _recipe(planned: PlannedRun) -> dict[str, str | int | None]:
    """Return what a run is driven from, for its file's metadata."""
    from cosim.provenance import sha256
    from cosim.vehicle import builtin_fmu

    digests = {
        name: sha256(path)
        for name, path in (("scenario_sha256", planned.scenario), ("fmu_sha256", builtin_fmu()))
    }
    return {
        "scenario": planned.scenario.name,
        "surface": planned.surface,
        "dampers": planned.dampers,
        "seed": planned.seed,
        **digests,
    }


def drive(planned: PlannedRun, directory: Path) -> str:
    """Drive one run without a sensor, write it, and return its stem."""
    from cosim.assembly import STEP_S, assemble
    from cosim.controller import SwitchingDampers
    from cosim.scenario.controllers import Passive
    from cosim.scenario.load import load
    from sensor.dataset import write_run

    scenario = load(planned.scenario, planned.overrides)
    switching = planned.dampers == "switching"
    dampers = SwitchingDampers(planned.seed, STEP_S) if switching else None
    assembly = assemble(scenario, Passive(kind="passive"), NoSensor(), dampers)
    result = assembly.run(None)
    if result.lap_time_s is None:
        raise InputError(f"{planned.scenario}: the lap was not finished, so it is no training run")
    run = run_of(assembly.recorder, assembly.initial_command, planned.stem, _recipe(planned))
    part = directory / f".{planned.stem}.part"
    write_run(part, run)
    part.replace(directory / f"{planned.stem}.parquet")
    return planned.stem


def run_of(recorder: Recorder, initial: Array, name: str, recipe: Mapping[str, Any]) -> Run:
    """Return what was recorded as a run of a data set.

    A command of the record is held behind its sample, one of the run before it; the first sample
    has the `initial` command (4,).
    """
    from cosim.controller import held
    from sensor.dataset import Run

    recorded = {
        "channels": recorder.group("channels"),
        "stage": recorder.columns([channel.name for channel in STAGE]),
        "commands": held(recorder.group("command"), initial),
        "truth": recorder.group("truth"),
        "road": recorder.columns([channel.name for channel in ROAD]),
    }
    parts = {group: values.astype(np.float32) for group, values in recorded.items()}
    return Run(name=name, recipe=recipe, **parts)


class NoSensor:
    """Stands where the sensor belongs while the data to train it are driven; never valid."""

    def __init__(self) -> None:
        self.estimate: Array = np.full(4, np.nan)

    def step(self, measured: Array, command: Array) -> bool:
        """Return False."""
        return False


def drive_all(
    recipe_file: Path, directory: Path, workers: int, progress: Callable[[str], None]
) -> int:
    """Drive a recipe's runs in spawned processes, one FMU each; return how many there are."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    runs = plan(load_recipe(recipe_file), recipe_file.parent)
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as executor:
        build(runs, directory, executor, progress)
    return len(runs)
