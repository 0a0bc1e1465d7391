"""From a scenario's faults and latencies to the blocks of one run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from cosim.faults.fault import Array, Fault, Mask, mask_of
from cosim.faults.latency import LateDampers, LateSensor, PromptDampers
from cosim.faults.messages import Delay, Dropout, Jitter, SwappedWheels
from cosim.faults.stack import FaultStack, NoFaults
from cosim.faults.values import (
    Bias,
    Drift,
    Gain,
    Noise,
    Quantisation,
    Saturation,
    Spikes,
    Stuck,
)
from cosim.faults.window import Window
from cosim.scenario import faults as settings
from cosim.scenario.fault_channels import indices
from sensor.channels import CHANNEL_NAMES, SAMPLE_RATE_HZ
from sensor.missing import HeldSamples

if TYPE_CHECKING:
    from cosim.loop import DamperBlock, FaultBlock, SensorBlock
    from cosim.scenario.latency import Latency
    from cosim.scenario.osp_scenario import Acting
    from sensor.estimator import Estimator

_SALT: Final = 0xFA017  # keeps these draws apart from others of the same seed
_PER_MS: Final = SAMPLE_RATE_HZ / 1000.0


def fault_block(acting: Sequence[Acting], seed: int) -> FaultBlock:
    """Return the faults of a scenario with this seed as one block."""
    if not acting:
        return NoFaults()
    made = [
        _fault(fault, source(fault, place, seed))
        for place, entry in enumerate(acting)
        for fault in entry.faults
    ]
    return FaultStack(made, leave_gaps(acting))


def source(fault: settings.PlainFault, place: int, seed: int) -> np.random.Generator:
    """Return what a fault draws from: by the scenario's seed, and its own or its place."""
    own = getattr(fault, "seed", None)
    return np.random.default_rng([_SALT, seed, *((0, place) if own is None else (1, own))])


def leave_gaps(acting: Sequence[Acting]) -> bool:
    """Whether the faults may make a channel NaN."""
    faults = (fault for entry in acting for fault in entry.faults)
    return any(isinstance(f, settings.Dropout) and f.fill == "nan" for f in faults)


def over_gaps(estimator: Estimator, acting: Sequence[Acting]) -> SensorBlock:
    """Return the estimator, made to bear NaN if one of the faults makes a channel NaN."""
    return HeldSamples(estimator) if leave_gaps(acting) else estimator


def late_sensor(sensor: SensorBlock, latency: Latency) -> SensorBlock:
    """Return the sensor with its latency."""
    samples = round(latency.sensor_ms * _PER_MS)
    return LateSensor(sensor, samples) if samples else sensor


def damper_block(latency: Latency, initial: Array) -> DamperBlock:
    """Return the way from the controller to the dampers, which hold `initial` (4,) at first."""
    samples = round(latency.damper_ms * _PER_MS)
    return LateDampers(samples, initial) if samples else PromptDampers()


def _fault(fault: settings.PlainFault, random: np.random.Generator) -> Fault:
    window = Window.of(fault.start_s, fault.end_s, getattr(fault, "ramp_s", 0.0))
    if isinstance(fault, settings.SwappedWheels):
        one, other = (CHANNEL_NAMES.index(f"Car.v{wheel}") for wheel in fault.wheels)
        return SwappedWheels(window, one, other)
    mask = mask_of(indices(fault.channels))
    match fault:
        case settings.Noise():
            return Noise(window, mask, fault.rms, random)
        case settings.Spikes():
            return Spikes(window, mask, fault.height, fault.rate_hz / SAMPLE_RATE_HZ, random)
        case settings.Delay():
            return Delay(window, mask, fault.delay_ms * _PER_MS)
        case settings.Jitter():
            return Jitter(window, mask, fault.max_ms * _PER_MS, random)
        case settings.Dropout():
            outage = None if fault.outage_s is None else fault.outage_s * SAMPLE_RATE_HZ
            return Dropout(window, mask, fault.share, outage, fault.fill == "hold", random)
        case _:
            return _certain(fault, window, mask)


def _certain(
    fault: settings.Bias
    | settings.Drift
    | settings.Gain
    | settings.Quantisation
    | settings.Saturation
    | settings.Stuck,
    window: Window,
    mask: Mask,
) -> Fault:
    match fault:
        case settings.Bias():
            return Bias(window, mask, fault.value)
        case settings.Drift():
            return Drift(window, mask, fault.rate)
        case settings.Gain():
            return Gain(window, mask, fault.factor)
        case settings.Quantisation():
            return Quantisation(window, mask, fault.step)
        case settings.Saturation():
            low = -math.inf if fault.min is None else fault.min
            return Saturation(window, mask, low, math.inf if fault.max is None else fault.max)
        case settings.Stuck():
            return Stuck(window, mask, fault.value)
