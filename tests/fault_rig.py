"""What tests of the faults share: faults as a scenario has them, and channels sent through them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import TypeAdapter

from cosim.faults.assemble import fault_block
from cosim.loop import FaultBlock
from cosim.scenario.faults import Fault
from cosim.scenario.osp_scenario import acting
from cosim.scenario.source import Source
from sensor.channels import CHANNEL_NAMES

Array = npt.NDArray[np.float64]

H = 0.01  # s
AZ, VFL = CHANNEL_NAMES.index("Car.az"), CHANNEL_NAMES.index("Car.vFL")
WHEELS = slice(CHANNEL_NAMES.index("Car.vFL"), CHANNEL_NAMES.index("Car.vRR") + 1)
_FAULTS: TypeAdapter[Any] = TypeAdapter(tuple[Fault, ...])


def settings(*faults: dict[str, Any]) -> tuple[Fault, ...]:
    """Return faults as they are read from a scenario."""
    made: tuple[Fault, ...] = _FAULTS.validate_python(faults)
    return made


def block(*faults: dict[str, Any], seed: int = 1) -> FaultBlock:
    """Return faults as one block of the loop."""
    return fault_block(acting(settings(*faults), Source())[0], seed)


def through(channels: Array, *faults: dict[str, Any], seed: int = 1) -> Array:
    """Return channels (samples, 14) as the sensor gets them."""
    stack = block(*faults, seed=seed)
    return np.array([stack.step(k, sample).copy() for k, sample in enumerate(channels)])


def errors(samples: int, *faults: dict[str, Any], channel: int = AZ, seed: int = 1) -> Array:
    """Return what faults add to channels that are 0, (samples,) of one channel."""
    return through(np.zeros((samples, 14)), *faults, seed=seed)[:, channel]


def varied(samples: int, seed: int = 0) -> Array:
    """Return channels (samples, 14) of which no two values are alike."""
    return np.random.default_rng(seed).normal(size=(samples, 14)) * 10.0


def clock(samples: int) -> Array:
    """Return channels (samples, 14) that are the time in samples, so that a value tells its age."""
    return np.repeat(np.arange(float(samples))[:, np.newaxis], 14, axis=1)
