"""One trial of the search: a short training, and what it reached.

A trial that falls behind stops early and counts with what it had reached, since Optuna's sampler
ignores pruned ones.
"""

import time
from collections.abc import Callable, Sequence
from statistics import median

from optuna.study import Study
from optuna.trial import Trial

from sensor.dataset import Run
from sensor.recipe import EarlyStop, Recipe, SearchRecipe
from sensor.search.study import finished
from sensor.training import Trainer
from sensor.training_data import window_sets

Said = Callable[[str], None]


class WindowObjective:
    """What a trial of one window is: train the shape, return the best validation RMSE [m/s]."""

    def __init__(
        self,
        recipe: SearchRecipe,
        window: int,
        runs: tuple[Sequence[Run], Sequence[Run]],
        say: Said = lambda text: None,
    ) -> None:
        self._recipe, self._window, self._runs, self._say = recipe, window, runs, say

    def __call__(self, trial: Trial) -> float:
        """Do one trial and keep its course in the study."""
        units, hidden = (
            trial.suggest_int(name, span.least, span.most)
            for name, span in (("units", self._recipe.units), ("hidden", self._recipe.hidden))
        )
        recipe = self._recipe.trial(self._window, units, hidden)
        start = time.perf_counter()
        best = self._train(trial, recipe)
        trial.set_user_attr("seconds", round(time.perf_counter() - start, 1))
        self._say(
            f"window {self._window}, trial {trial.number + 1}: {units} x {hidden} units, "
            f"{1e3 * best:.2f} mm/s"
        )
        return best

    def _train(self, trial: Trial, recipe: Recipe) -> float:
        trainer = Trainer.of(recipe, *window_sets(recipe, *self._runs))
        for epoch in range(recipe.training.epochs):
            trainer.run_epoch(epoch)
            reached = trainer.reached.epochs[-1]["validation_rmse"]
            trial.report(reached, epoch + 1)
            if falls_behind(self._recipe.stop, trial.study, epoch + 1, reached):
                break
        trial.set_user_attr("epochs", len(trainer.reached.epochs))
        return trainer.reached.best


def falls_behind(stop: EarlyStop | None, study: Study, epoch: int, reached: float) -> bool:
    """Tell whether a trial that has `reached` so much [m/s] after `epoch` epochs should stop."""
    if stop is None or epoch < stop.after:
        return False
    courses = [trial.intermediate_values for trial in finished(study)]
    there = [course[epoch] for course in courses if epoch in course]
    return len(there) >= 2 and reached > (1.0 + stop.behind) * median(there)
