"""Calibration of the bumpy road: the table of docs/roads.md.

`python docs/measure/bumps.py` drives over alternating bumps of several lengths and spacings, finds
for each the height that comes nearest to the suspension velocities of the published study, and
prints Markdown, the best geometry first. About two minutes.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.assembly import assemble
from cosim.dataset import NoSensor
from cosim.scenario.load import load
from sensor.metrics import rms

SPEEDS_KMH = (15, 25, 32)
WANTED = np.array([0.060, 0.085, 0.137])  # true relative velocity, rms over the wheels [m/s]
GEOMETRIES = (
    *((length, 1.5) for length in (0.5, 1.0, 1.2, 1.3, 1.4, 1.5)),
    *((spacing - 0.1, spacing) for spacing in (1.3, 1.4, 1.45, 1.55, 1.6, 1.8, 2.5)),
    (0.5, 4.0),
    (1.0, 5.0),
)
SCENARIO = """\
name: bumpy road
duration: lap
road: {track: straight, length_m: 200, surface: smooth}
"""
FIRST_HEIGHT = 0.013
ROUNDS = 3


class Fit(NamedTuple):
    """A geometry [m] and the velocities it brings about [m/s] at the three speeds."""

    length: float
    spacing: float
    height: float
    velocity: npt.NDArray[np.float64]

    @property
    def worst(self) -> float:
        """Largest deviation from what is wanted, as a share."""
        return float(np.abs(self.velocity / WANTED - 1.0).max())


def velocity(path: Path, length: float, spacing: float, height: float, speed: int) -> float:
    """Return the rms of the true suspension velocity over wheels and samples [m/s]."""
    bumps = f"{{kind: bumps, height_m: {height}, length_m: {length}, spacing_m: {spacing}}}"
    scenario = load(path, [f"road.obstacles=[{bumps}]", f"driver.speed_kmh={speed}"])
    assembly = assemble(scenario, scenario.controllers[0], NoSensor())
    assembly.run(None)
    return rms(assembly.recorder.group("truth"))


def fit(path: Path, length: float, spacing: float) -> Fit:
    """Return the geometry with the height that comes nearest at all three speeds together."""
    height = FIRST_HEIGHT
    for _ in range(ROUNDS):
        found = np.array([velocity(path, length, spacing, height, v) for v in SPEEDS_KMH])
        best = Fit(length, spacing, height, found)
        height = round(height * float(np.exp(np.log(WANTED / found).mean())), 4)
    return best


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bumps.yaml"
        path.write_text(SCENARIO, encoding="utf-8")
        fits = sorted((fit(path, *pair) for pair in GEOMETRIES), key=lambda one: one.worst)
    print("| length, m | spacing, m | height, mm | 15 km/h | 25 km/h | 32 km/h | worst, % |")
    print("|---|---|---|---|---|---|---|")
    for one in fits:
        figures = " | ".join(f"{1e3 * v:.1f}" for v in one.velocity)
        size = f"{one.length:g} | {one.spacing:g} | {1e3 * one.height:.1f}"
        print(f"| {size} | {figures} | {100 * one.worst:.1f} |")


if __name__ == "__main__":
    main()
