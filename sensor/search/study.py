"""The Bayesian search over the network's shape, as in the paper (section 3.2): for each window size
a study of its own over the units of the LSTM and of the dense layer, led by a Gaussian process.

All studies lie in one SQLite file, so a search goes on where it was stopped, and several processes
may work on it at the same time. Windows take turns: however early a search is stopped, each has had
about as many trials. Every draw depends on (seed, window, trials before); one process alone
therefore ends in the same trials, interrupted or not.
"""

import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import optuna
from optuna.distributions import BaseDistribution, IntDistribution
from optuna.samplers import BaseSampler, GPSampler
from optuna.storages import BaseStorage, RDBStorage
from optuna.study import Study
from optuna.trial import FrozenTrial, Trial, TrialState
from scipy.stats import qmc

from sensor.errors import SensorError
from sensor.recipe import SearchRecipe

Objective = Callable[[Trial], float]


class SeededSampler(BaseSampler):
    """Sobol points for the first trials, then a Gaussian process (Optuna's GPSampler: Matern 5/2,
    logarithm of the expected improvement), seeded anew for each trial.
    """

    def __init__(self, space: dict[str, BaseDistribution], seed: int, startup: int) -> None:
        self._space, self._seed, self._startup = space, seed, startup

    def infer_relative_search_space(
        self, study: Study, trial: FrozenTrial
    ) -> dict[str, BaseDistribution]:
        """Return the whole space, which is known beforehand."""
        return self._space

    def sample_relative(
        self, study: Study, trial: FrozenTrial, search_space: dict[str, BaseDistribution]
    ) -> dict[str, Any]:
        """Return the parameters of a trial."""
        before = sum(other.number < trial.number for other in taken(study))
        if before < self._startup or len(finished(study)) < 2:
            return self._spread(before)
        seed = int(np.random.SeedSequence([self._seed, before]).generate_state(1)[0])
        return GPSampler(seed=seed, n_startup_trials=0).sample_relative(study, trial, search_space)

    def sample_independent(self, *_: Any) -> Any:
        """Never asked: the space is fixed."""
        raise NotImplementedError

    def _spread(self, number: int) -> dict[str, Any]:
        """Return the Sobol point of that number, the same for all trials of a seed."""
        engine = qmc.Sobol(len(self._space), rng=np.random.default_rng(self._seed))
        if number:
            engine.fast_forward(number)
        return {
            name: int(span.low + share * (span.high + 1 - span.low))
            for (name, span), share in zip(self._space.items(), engine.random(1)[0], strict=True)
            if isinstance(span, IntDistribution)
        }


def open_storage(path: Path, heartbeat_s: int = 20, grace_s: int = 60) -> BaseStorage:
    """Open the file of the studies; makes it where there is none.

    A trial whose process has given no sign of life for `grace_s` counts as failed.
    """
    with warnings.catch_warnings():
        # Optuna calls heartbeats experimental; without them a killed process's trial never ends.
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        return RDBStorage(
            f"sqlite:///{path}",
            engine_kwargs={"connect_args": {"timeout": 60}},
            heartbeat_interval=heartbeat_s,
            grace_period=grace_s,
        )


def open_study(storage: BaseStorage, recipe: SearchRecipe, window: int) -> Study:
    """Open a window's study, new or as it was left.

    Raises SensorError if the trials there are of another recipe; `trials` alone may differ, so that
    a search can be prolonged.
    """
    space: dict[str, BaseDistribution] = {
        name: IntDistribution(span.least, span.most)
        for name, span in (("units", recipe.units), ("hidden", recipe.hidden))
    }
    seed = int(np.random.SeedSequence([recipe.seed, window]).generate_state(1)[0])
    study = optuna.create_study(
        storage=storage,
        study_name=f"{recipe.name}_w{window}",
        sampler=SeededSampler(space, seed, recipe.startup),
        load_if_exists=True,
    )
    begun = study.user_attrs.get("recipe")
    if begun is None:
        study.set_user_attr("recipe", recipe.model_dump(mode="json"))
    elif not recipe.continues(begun):
        raise SensorError(
            f"the search {recipe.name!r} was begun with another recipe; name this one anew, or "
            "choose another directory."
        )
    return study


def taken(study: Study) -> list[FrozenTrial]:
    """Return the trials that are finished or running."""
    return study.get_trials(deepcopy=False, states=(TrialState.COMPLETE, TrialState.RUNNING))


def finished(study: Study) -> list[FrozenTrial]:
    """Return the finished trials."""
    return study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))


def work(
    recipe: SearchRecipe, studies: Mapping[int, Study], objectives: Mapping[int, Objective]
) -> None:
    """Do trials, the windows in turn, until each has its number; wait for those that other
    processes still do, and do them if such a process dies.
    """
    while True:
        for window, study in studies.items():
            if len(taken(study)) < recipe.trials:
                study.optimize(_claimed(objectives[window], recipe.trials), n_trials=1)
        states = [trial.state for study in studies.values() for trial in taken(study)]
        if states.count(TrialState.COMPLETE) >= recipe.trials * len(studies):
            return
        if len(states) >= recipe.trials * len(studies):
            time.sleep(1.0)
            for study in studies.values():
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
                    optuna.storages.fail_stale_trials(study)


def _claimed(objective: Objective, trials: int) -> Objective:
    """Let go a trial that another process's has made superfluous while this one began."""

    def guarded(trial: Trial) -> float:
        before = [other for other in taken(trial.study) if other.number < trial.number]
        if len(before) >= trials:
            raise optuna.TrialPruned
        return objective(trial)

    return guarded
