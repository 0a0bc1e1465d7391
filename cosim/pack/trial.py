"""A packed FMU beside the network that it was made from: the same samples, the same estimates."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.errors import NetworkError
from cosim.sensor_fmu import FmuSensor
from sensor.channels import CHANNELS, COMMANDS
from sensor.errors import SensorError

Array = npt.NDArray[np.float64]

SAMPLES: Final = 250
EVERY: Final = 10  # estimates of a window, which take ONNX Runtime as long as W samples
TOLERANCE: Final = 1e-5  # m/s
# What an ordinary drive has: mean and spread of each channel, SI units
_MEAN: Final = np.array([*6 * (0.0,), 20.0, 0.0, 0.0, *4 * (20.0,), 0.0])
_SPREAD: Final = np.array(
    [0.8, 1.0, 1.0, *3 * (0.05,), 0.1, 0.02, 0.02, *4 * (0.1,), 0.3]
)  # fmt: skip
_SMOOTH: Final = 4  # samples over which the noise is averaged


def compare(fmu: Path, network: Path, window: int) -> float:
    """Run FMU and network over the same samples, drawn at random from a fixed seed; return the
    largest difference of their estimates [m/s].

    `window` is the network's, 1 for one with carried state. Raises `NetworkError` if the difference
    is above `TOLERANCE`, or one has estimates where the other has none; `FmuError` if it fails.
    """
    channels, commands = _samples(SAMPLES + window)
    sensor = FmuSensor(fmu)
    try:
        found = np.array(sensor.apply_with_deviation(channels, commands))
    finally:
        sensor.close()
    from sensor.carried.runtime import WARM_UP  # ONNX Runtime takes its time to load

    first = WARM_UP if window == 1 else window - 1
    counts = np.isfinite(found[0]).all(axis=1)
    if not np.array_equal(counts, np.arange(len(counts)) >= first):
        raise NetworkError(f"{network}: packed, it has estimates at other samples than before")
    expected = _answers(network, window, channels, commands)
    largest = float(np.nanmax(np.abs(found - expected)))
    if not largest <= TOLERANCE:
        raise NetworkError(
            f"{network}: packed, its estimates differ by {largest:.3g} m/s, where {TOLERANCE:g} m/s"
            " is allowed; nothing was written"
        )
    return largest


def _samples(count: int) -> tuple[Array, Array]:
    """Return channels (count, 14) and commands (count, 4)."""
    random = np.random.default_rng(2)
    noise = random.standard_normal((count + _SMOOTH, len(CHANNELS))).cumsum(axis=0)
    smooth = (noise[_SMOOTH:] - noise[:-_SMOOTH]) / np.sqrt(_SMOOTH)
    commands = np.repeat(random.random((count // 10 + 1, len(COMMANDS))), 10, axis=0)[:count]
    return _MEAN + _SPREAD * smooth, commands


def _answers(network: Path, window: int, channels: Array, commands: Array) -> Array:
    """Return what `_expected` does; raises `NetworkError` if the network does not run."""
    try:
        return _expected(network, window, channels, commands)
    except SensorError:
        raise
    except Exception as error:  # ONNX Runtime's exceptions share no public base class
        raise NetworkError(f"{network}: ONNX Runtime cannot run it: {error}") from error


def _expected(network: Path, window: int, channels: Array, commands: Array) -> Array:
    """Return the network's own estimates and deviations (2, count, 4), NaN where they are not asked
    for.
    """
    from sensor.carried.runtime import CarriedSensor
    from sensor.runtime import open_session

    if window == 1:
        return np.array(CarriedSensor(network).apply_with_deviation(channels, commands))
    session = open_session(network)
    samples = channels.astype(np.float32)
    estimates = np.full((2, len(channels), 4), np.nan)
    name = session.get_inputs()[0].name
    for last in range(window - 1, len(samples), EVERY):  # many exporters write a batch of one
        one = samples[np.newaxis, last - window + 1 : last + 1]
        estimates[0, last] = session.run(None, {name: one})[0]
    return estimates
