"""Interleaved timing of forms of one network, which must agree on its estimates."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from network_forms import Form

from sensor.features import WHEEL_SPEEDS

Array = npt.NDArray[np.float64]
ROUNDS, SECONDS = 40, 0.05  # of each form in each round
LEAST, MOST = 5, 400  # samples of a form in a round
WARM_UP = 3  # samples after another form has had the caches
TOLERANCE = 1e-5  # m/s
COMMAND: Final = np.full(4, 0.3)


@dataclass(frozen=True)
class Time:
    """Median and 99th percentile [us] per sample; largest distance from the first form's estimates
    [m/s] as text, "-" where there are none.
    """

    median: float
    p99: float
    off: str


def drive(samples: int) -> Array:
    """Return channels (samples, 14) of a car at 20 m/s, in SI units."""
    random = np.random.default_rng(0)
    channels = random.normal(scale=0.3, size=(samples, 14))
    channels[:, [3, 4, 5, 7, 8, 13]] *= 0.1
    channels[:, 6] = 20.0
    channels[:, WHEEL_SPEEDS] = 20.0 + random.normal(scale=0.02, size=(samples, 4))
    return channels.astype(np.float32).astype(np.float64)


def timed(forms: Sequence[Form], settling: int) -> dict[str, Time]:
    """Return the times of each form by its name. Ends the program if two forms disagree on the
    estimates behind the first `settling` samples.
    """
    samples = drive(settling + 40)
    estimates = {form.name: _estimates(form, samples)[settling:] for form in forms}
    first = next(iter(estimates.values()))
    assert first is not None
    off = {}
    for name, found in estimates.items():
        if np.isnan(found).all():
            off[name] = "-"
            continue
        difference = float(np.abs(found - first).max())
        off[name] = f"{difference:.0e}"
        if not difference <= TOLERANCE:
            sys.exit(f"{name} is {difference:.2g} m/s off {forms[0].name}")
    spent = _rounds(forms, samples)
    return {
        name: Time(float(np.median(t)), float(np.percentile(t, 99)), off[name])
        for name, t in spent.items()
    }


def _estimates(form: Form, samples: Array) -> Array:
    rows = np.full((len(samples), 4), np.nan)
    for row, sample in zip(rows, samples, strict=True):
        form.take(sample)
        if form.estimate is not None:
            row[:] = form.estimate()
    return rows


def _rounds(forms: Sequence[Form], samples: Array) -> dict[str, Array]:
    """Return the times [us] of all samples of each form."""
    counts = {form.name: _count(form, samples) for form in forms}
    spent: dict[str, list[Array]] = {form.name: [] for form in forms}
    for _ in range(ROUNDS):
        for form in forms:
            for sample in samples[:WARM_UP]:
                form.take(sample)
            spent[form.name].append(_spent(form, samples, counts[form.name]))
    return {name: np.concatenate(parts) for name, parts in spent.items()}


def _count(form: Form, samples: Array) -> int:
    """Return how many samples fill a form's part of a round."""
    once = float(np.median(_spent(form, samples, LEAST))) / 1e6
    return int(np.clip(SECONDS / once, LEAST, MOST))


def _spent(form: Form, samples: Array, count: int) -> Array:
    times = np.empty(count)
    take, clock = form.take, time.perf_counter
    for k in range(count):
        sample = samples[k % len(samples)]
        begin = clock()
        take(sample)
        times[k] = clock() - begin
    return 1e6 * times
