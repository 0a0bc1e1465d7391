"""What a network file says of itself."""

import json
from dataclasses import dataclass
from typing import Any, Final, Literal

from sensor.channels import CHANNELS, OUTPUTS, SAMPLE_RATE_HZ, check_channels
from sensor.errors import SensorError

METADATA_KEY: Final = "sensor"
CARRIED: Final = "carried"


@dataclass(frozen=True)
class ModelInfo:
    """What a network file says of itself: its kind, window [samples] (1 for carried state), sample
    rate [Hz], all metadata.
    """

    kind: Literal["windowed", "carried"]
    window: int
    sample_rate_hz: float
    metadata: dict[str, Any]


def read_metadata(text: str | None, source: str) -> ModelInfo:
    """Read and check the metadata of the network file `source`; raises SensorError naming
    everything that differs from this sensor's channels.
    """
    if text is None:
        raise SensorError(
            f"{source}: its metadata has no entry {METADATA_KEY!r}; its channels are unknown."
            " docs/sensor-c.md shows how to add it."
        )
    try:
        metadata = json.loads(text)
        inputs, outputs = metadata["inputs"], metadata["outputs"]
        rate = float(metadata["sample_rate_hz"])
        carried = metadata.get("kind") == CARRIED
        window = 1 if carried else int(metadata["window"])
        info = ModelInfo("carried" if carried else "windowed", window, rate, metadata)
        named = [(list(part["names"]), list(part["units"])) for part in (inputs, outputs)]
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        raise SensorError(f"{source}: its metadata lacks or misspells {error}.") from error
    check_channels(f"{source}, inputs", *named[0], CHANNELS)
    check_channels(f"{source}, outputs", *named[1], OUTPUTS)
    if info.sample_rate_hz != SAMPLE_RATE_HZ:
        raise SensorError(
            f"{source}: it expects {info.sample_rate_hz:g} Hz, where {SAMPLE_RATE_HZ} Hz belongs."
        )
    return info
