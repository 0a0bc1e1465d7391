"""What tests of the loop share: short scenarios, and stand-ins for single blocks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

WINDOW = 19


class Blind:
    """A sensor that never has an estimate."""

    def __init__(self) -> None:
        self.estimate: Array = np.full(4, np.nan)
        self.deviation: Array = np.full(4, np.nan)

    def step(self, measured: Array, command: Array) -> bool:
        return False


class Guess:
    """A sensor of known output: a hundredth of Car.az at every wheel, once its window is full."""

    def __init__(self, window: int = WINDOW) -> None:
        self.estimate: Array = np.full(4, np.nan)
        self.deviation: Array = np.full(4, np.nan)
        self._missing = window

    def step(self, measured: Array, command: Array) -> bool:
        self._missing -= 1
        if self._missing > 0:
            return False
        self.estimate[:] = 0.01 * measured[2] * np.arange(1, 5)
        return True


def write_scenario(
    folder: Path,
    *,
    duration: str = "1",
    length_m: float = 150,
    surface: str = "smooth",
    obstacles: str = "",
    sections: Mapping[str, str] | None = None,
    name: str = "scenario",
) -> Path:
    """Write a scenario on the straight track to `folder`; `sections` are YAML by field name."""
    fields = {
        "name": "a straight road",
        "duration": duration,
        "road": f"{{track: straight, length_m: {length_m}, surface: {surface}, "
        f"obstacles: [{obstacles}]}}",
        "driver": "{speed_kmh: 50}",
    } | dict(sections or {})
    path = folder / f"{name}.yaml"
    path.write_text("".join(f"{key}: {text}\n" for key, text in fields.items()), encoding="utf-8")
    return path
