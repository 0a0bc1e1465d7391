"""Does a longer window help? The wheelbase delay seen from it, and a linear filter's error."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pictures import picture

from sensor.channels import CHANNEL_NAMES, SAMPLE_RATE_HZ
from sensor.dataset import Run
from sensor.features import with_residuals
from sensor.paper.reading import WHEELBASE_M

Array = npt.NDArray[np.float64]

WINDOWS = (3, 7, 11, 17, 19, 21, 25, 31, 51, 64)
RIDGE = 1e-7  # relative to unit variance
_LONGEST = max(WINDOWS)
_CHUNK = 4096
_SPEED = CHANNEL_NAMES.index("Car.vx")


@dataclass(frozen=True)
class Sweep:
    """Accuracy [%] of a linear filter on unseen runs, by window [samples], without and with the
    wheel-speed residuals beside the 14 channels.
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
    return Sweep(
        _accuracies(training, unseen, lambda run: run.channels.astype(np.float64)),
        _accuracies(training, unseen, lambda run: with_residuals(run.channels)),
    )


def _accuracies(
    training: Sequence[Run], unseen: Sequence[Run], features: Callable[[Run], Array]
) -> dict[int, float]:
    """One pass for the longest window; a shorter one's equations are a corner of its own."""
    whole = np.concatenate([features(run) for run in training])
    mean, deviation = whole.mean(axis=0), whole.std(axis=0)

    def pairs(runs: Sequence[Run]) -> Iterator[tuple[Array, Array]]:
        for run in runs:
            yield from _chunks((features(run) - mean) / deviation, run.truth.astype(np.float64))

    width = len(mean)
    size = _LONGEST * width + 1
    gram, moment, count = np.zeros((size, size)), np.zeros((size, 4)), 0
    for rows, truth in pairs(training):
        gram += rows.T @ rows
        moment += rows.T @ truth
        count += len(rows)
    weights = {}
    for window in WINDOWS:
        first = (_LONGEST - window) * width  # oldest sample first, the constant last
        part = gram[first:, first:] + RIDGE * count * np.eye(size - first)
        weights[window] = np.zeros((size, 4))
        weights[window][first:] = np.linalg.solve(part, moment[first:])
    stacked = np.concatenate(list(weights.values()), axis=1)
    errors, truths = np.zeros(len(WINDOWS)), 0.0
    for rows, truth in pairs(unseen):
        error = (rows @ stacked).reshape(len(rows), len(WINDOWS), -1) - truth[:, np.newaxis]
        errors += np.square(error).sum(axis=(0, 2))
        truths += np.square(truth).sum()
    return dict(zip(WINDOWS, 100.0 * (1.0 - np.sqrt(errors / truths)), strict=True))


def _chunks(x: Array, truth: Array) -> Iterator[tuple[Array, Array]]:
    """Yield the longest windows, flat and with a constant, and the truth at their last samples."""
    windows = np.lib.stride_tricks.sliding_window_view(x, _LONGEST, axis=0).transpose(0, 2, 1)
    for start in range(0, len(windows), _CHUNK):
        chunk = windows[start : start + _CHUNK]
        rows = np.ones((len(chunk), chunk[0].size + 1))
        rows[:, :-1] = chunk.reshape(len(chunk), -1)
        first = _LONGEST - 1 + start
        yield rows, truth[first : first + len(rows)]


def window_figure(file: Path, sweeps: Mapping[str, Sweep]) -> None:
    """Draw accuracy against window for each surface."""
    with picture(file, figsize=(6.4, 3.4)) as (_, axes):
        for (surface, found), colour in zip(sweeps.items(), ("tab:blue", "tab:red"), strict=False):
            for values, style, what in (
                (found.raw, "o-", "14 channels"),
                (found.residual, "s--", "with residuals"),
            ):
                label = f"{surface}, {what}"
                line = list(values.values())
                axes.plot(list(values), line, style, color=colour, label=label, markersize=3)
        axes.set(xlabel="window, samples of 10 ms", ylabel="accuracy of the linear filter, %")
        axes.set(ylim=(30, 100), xlim=(0, 66))
        axes.legend(fontsize=8, ncols=2)
