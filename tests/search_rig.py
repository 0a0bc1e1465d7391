"""A search that is over in a second: a known error in place of trainings, also in processes of
their own, which therefore must not load torch.
"""

import multiprocessing
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import optuna
from optuna.study import Study
from optuna.trial import Trial

from sensor.recipe import SearchRecipe
from sensor.search.study import finished, open_storage, open_study, work


def make_recipe(**changes: Any) -> SearchRecipe:
    content = {
        "name": "small",
        "windows": [3, 5],
        "units": {"least": 1, "most": 15},
        "hidden": {"least": 1, "most": 15},
        "trials": 6,
        "startup": 3,
        "training": {"epochs": 3, "batch_size": 64, "windows_per_epoch": 256},
        "runs": {"training": ["a", "b"], "validation": ["c"]},
    }
    return SearchRecipe.model_validate(content | changes)


def bowl(units: Any, hidden: Any) -> Any:
    """An error with its minimum of 0.01 at 6 x 9, flatter along the dense layer."""
    return 0.01 * (1.0 + ((units - 6) / 5) ** 2 + ((hidden - 9) / 9) ** 2)


def measured_bowl(trial: Trial) -> float:
    return bowl(trial.suggest_int("units", 1, 15), trial.suggest_int("hidden", 1, 15))


def open_all(recipe: SearchRecipe, folder: Path) -> dict[int, Study]:
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    storage = open_storage(folder / "studies.sqlite3", heartbeat_s=1, grace_s=2)
    return {window: open_study(storage, recipe, window) for window in recipe.windows}


def slow_bowl(trial: Trial) -> float:
    trial.set_user_attr("process", os.getpid())
    time.sleep(0.5)
    return measured_bowl(trial)


def hanging(trial: Trial) -> float:
    if len(finished(trial.study)) == 1:
        time.sleep(1000.0)
    return measured_bowl(trial)


def help_with(folder: Path, objective: Callable[[Trial], float]) -> None:
    recipe = make_recipe()
    studies = open_all(recipe, folder)
    work(recipe, studies, dict.fromkeys(studies, objective))


def start(folder: Path, objective: Callable[[Trial], float]) -> Any:
    process = multiprocessing.get_context("spawn").Process(
        target=help_with, args=(folder, objective), daemon=True
    )
    process.start()
    return process
