"""The statistics of the faults beside theory: a table of docs/faults.md."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import TypeAdapter

from cosim.faults.assemble import fault_block
from cosim.scenario.faults import Fault
from cosim.scenario.osp_scenario import acting
from cosim.scenario.source import Source
from sensor.channels import CHANNEL_NAMES, SAMPLE_RATE_HZ

Array = npt.NDArray[np.float64]
SAMPLES = 100_000
CHANNEL = "Car.az"
_AT = CHANNEL_NAMES.index(CHANNEL)
_FAULTS: TypeAdapter[Any] = TypeAdapter(tuple[Fault, ...])


def through(course: Array, **fault: Any) -> Array:
    """Return a course of one channel (samples,) after a fault."""
    faults = _FAULTS.validate_python([{"channels": CHANNEL, **fault}])
    block = fault_block(acting(faults, Source())[0], 1)
    sample, found = np.zeros(len(CHANNEL_NAMES)), np.empty_like(course)
    for k, value in enumerate(course):
        sample[_AT] = value
        found[k] = block.step(k, sample)[_AT]
    return found


def rows() -> Iterator[tuple[str, str, str, str]]:
    """Yield fault, figure, theory and measurement."""
    nothing, clock = np.zeros(SAMPLES), np.arange(float(SAMPLES))
    varied = np.random.default_rng(1).normal(size=SAMPLES)
    noise = through(nothing, kind="noise", rms=0.3)
    yield "noise, 0.3 m/s² rms", "standard deviation, m/s²", "0.3", f"{noise.std():.4f}"
    yield "", "correlation of neighbours", "0", f"{np.corrcoef(noise[1:], noise[:-1])[0, 1]:+.4f}"
    drift = through(nothing, kind="drift", rate="0.6 m/s2/min")
    slope = np.polyfit(clock / SAMPLE_RATE_HZ, drift, 1)[0]
    yield "drift, 0.6 m/s² per minute", "slope, m/s³", "0.01", f"{slope:.6f}"
    error = through(varied, kind="quantisation", step=0.04) - varied
    yield (
        "quantisation, 0.04 m/s²",
        "rms error, step/√12",
        f"{0.04 / 12**0.5:.5f}",
        f"{error.std():.5f}",
    )
    spikes = np.count_nonzero(through(nothing, kind="spikes", height=1.0, rate_hz=5.0))
    yield "spikes, 5 Hz", "per second", "5", f"{spikes / SAMPLES * SAMPLE_RATE_HZ:.3f}"
    late = age(through(clock, kind="delay", delay_ms=12.5))
    yield "delay, 12.5 ms", "age, ms", "12.5", f"{late.min():.4f} to {late.max():.4f}"
    for longest in (8.0, 35.0):
        found = age(through(clock, kind="jitter", max_ms=longest))
        mean = mean_age(longest)
        yield f"jitter, up to {longest:g} ms", "mean age, ms", f"{mean:.3f}", f"{found.mean():.3f}"
    lost = np.isnan(through(varied, kind="dropout", fill="nan", share=0.25, outage_s=0.08))
    edges = np.flatnonzero(np.diff(np.concatenate(([0], lost.astype(int), [0]))))
    length = (edges[1::2] - edges[::2]).mean() / SAMPLE_RATE_HZ
    yield "dropout, 25 % in outages of 0.08 s", "share missing, %", "25", f"{100 * lost.mean():.2f}"
    yield "", "mean outage, s", "0.08", f"{length:.4f}"


def age(found: Array) -> Array:
    """Return the age [ms] of what is read of a channel that is the number of its sample."""
    return ((np.arange(len(found)) - found) * 1000.0 / SAMPLE_RATE_HZ)[100:]


def mean_age(longest: float) -> float:
    """Return the mean age [ms] under jitter: the integral of the chance that all draws since then
    are older.
    """
    ages = np.linspace(0.0, longest, 20_001)
    sample = 1000.0 / SAMPLE_RATE_HZ
    older = [1.0 - np.clip((ages - sample * n) / longest, 0.0, 1.0) for n in range(10)]
    return float(np.trapezoid(np.prod(older, axis=0), ages))
