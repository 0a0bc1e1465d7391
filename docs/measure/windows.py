"""Does a longer window help? The wheelbase delay seen from it, and a linear filter's error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pictures import picture

from sensor.baselines.normal_equations import Features, NormalEquations, Samples, Standard
from sensor.channels import CHANNEL_NAMES, SAMPLE_RATE_HZ
from sensor.dataset import Run
from sensor.paper.reading import WHEELBASE_M

WINDOWS = (3, 7, 11, 13, 17, 19, 21, 25, 31, 51, 64)
RIDGE = 1e-7
_SPEED = CHANNEL_NAMES.index("Car.vx")


@dataclass(frozen=True)
class Sweep:
    """Accuracy [%] of a linear filter on unseen runs, by window [samples], with the wheel speeds or
    with their residuals among the 14 channels.
    """

    raw: Mapping[int, float]
    residual: Mapping[int, float]


def seen(runs: Sequence[Run], window: int) -> float:
    """Share of driving time [%] in which a window reaches back to where the front wheels met what
    the rear wheels meet now: L / v_x <= (W - 1) 10 ms.
    """
    speed = np.concatenate([run.channels[:, _SPEED] for run in runs])
    return 100.0 * float(np.mean(speed * (window - 1) / SAMPLE_RATE_HZ >= WHEELBASE_M))


def sweep(training: Sequence[Run], unseen: Sequence[Run]) -> Sweep:
    """Fit the filter for each window on the same samples, and apply it to the unseen runs."""
    return Sweep(_accuracies(training, unseen, "raw"), _accuracies(training, unseen, "residual"))


def _accuracies(
    training: Sequence[Run], unseen: Sequence[Run], channels: Features
) -> dict[int, float]:
    """One pass for the longest window; a shorter one is not given the oldest samples."""
    seen_samples = Samples(training, channels=channels)
    standard = Standard.of(seen_samples)
    fitted = NormalEquations.of(seen_samples, max(WINDOWS), standard)
    checked = NormalEquations.of(Samples(unseen, channels=channels), max(WINDOWS), standard)
    nothing = np.zeros_like(checked.moment)
    nothing[-1] = -standard.output_mean / standard.output_std
    truth = np.square(checked.rmse(nothing)).mean()
    found = {}
    for window in WINDOWS:
        weights = _shortened(fitted, window).solve(RIDGE)
        error = np.square(checked.rmse(weights)).mean()
        found[window] = 100.0 * (1.0 - float(np.sqrt(error / truth)))
    return found


def _shortened(equations: NormalEquations, window: int) -> NormalEquations:
    """Return the equations without the samples that are older than a shorter window."""
    gone = (equations.window - window) * len(CHANNEL_NAMES)  # oldest sample first
    gram, moment = equations.gram.copy(), equations.moment.copy()
    gram[:gone], gram[:, :gone], moment[:gone] = 0.0, 0.0, 0.0
    return replace(equations, gram=gram, moment=moment)


def window_figure(file: Path, laps: Mapping[str, Sweep], steady: Mapping[float, Sweep]) -> None:
    """Draw accuracy against window: laps by surface, and straight roads by speed [km/h] with their
    wheelbase delay.
    """
    with picture(file, ncols=2, figsize=(8.4, 3.4), sharex=True) as (_, (left, right)):
        for (surface, found), colour in zip(laps.items(), ("tab:blue", "tab:red"), strict=True):
            for values, style, what in (
                (found.raw, "o-", "wheel speeds"),
                (found.residual, "s--", "residuals"),
            ):
                left.plot(*_line(values), style, color=colour, label=f"{surface}, {what}",
                          markersize=3)  # fmt: skip
        for (speed, found), colour in zip(steady.items(), ("tab:green", "tab:purple"), strict=True):
            label = f"class B at {speed:.0f} km/h"
            right.plot(*_line(found.raw), "o-", color=colour, label=label, markersize=3)
            delay = WHEELBASE_M / (speed / 3.6) * SAMPLE_RATE_HZ + 1
            right.axvline(delay, color=colour, linestyle=":", label="its wheelbase delay")
        left.set(title="laps of Hockenheim", ylabel="accuracy of the linear filter, %")
        right.set(title="one speed, straight ahead")
        for axes in (left, right):
            axes.set(xlabel="window, samples of 10 ms", xlim=(0, 66))
            axes.legend(fontsize=8, loc="lower right")


def _line(values: Mapping[int, float]) -> tuple[list[int], list[float]]:
    return list(values), list(values.values())
