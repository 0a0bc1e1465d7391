"""Spectra and ride of the surfaces: two tables of docs/roads.md.

`python docs/measure/surfaces.py` measures each surface's spectrum where the left wheels run and
drives over each; it prints Markdown. About half a minute.
"""

from __future__ import annotations

import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy import signal

from cosim.assembly import assemble
from cosim.dataset import NoSensor
from cosim.road import Cobbles, Iso8608
from cosim.road.grid import road_grid
from cosim.road.iso8608 import ROUGHNESS
from cosim.road.surface import FINE_STEP, Surface
from cosim.road.track import DS
from cosim.scenario.load import load
from sensor.metrics import rms

EDGES = (0.03, 0.1, 0.3, 1.0, 3.0, 5.0, 8.0)  # cycles/m
WHEEL = 0.778  # the left wheels' path [m]
SPEEDS_KMH = (30, 50, 80)
SCENARIO = """\
name: surface
duration: 20
road: {track: straight, length_m: 600}
driver: {speed_kmh: 50}
"""
Floats = npt.NDArray[np.float64]


def line(surface: Surface) -> Floats:
    """Return what a point meets on 3 km of the wheel's path, every 0.025 m [m]."""
    grid = road_grid(-20.0 + DS * np.arange(60_000), surface)
    right = int(np.searchsorted(grid.v, WHEEL)) - 1
    share = (WHEEL - grid.v[right]) / (grid.v[right + 1] - grid.v[right])
    met = grid.elevation[:, right] * (1 - share) + grid.elevation[:, right + 1] * share
    return np.interp(np.arange(20.0, 2970.0, FINE_STEP), grid.s, met)


def bands(surface: Surface, road_class: str) -> list[float]:
    """Return measured over nominal spectrum of the class, band by band."""
    frequency, density = signal.welch(line(surface), 1 / FINE_STEP, nperseg=8192, detrend="linear")
    ratio = density[1:] / (ROUGHNESS[road_class] * (frequency[1:] / 0.1) ** -2.0)
    inside = [(frequency[1:] >= low) & (frequency[1:] < high) for low, high in pairwise(EDGES)]
    return [float(ratio[band].mean()) for band in inside]


def main() -> None:
    """Print both tables."""
    heads = " | ".join(f"{low:g} to {high:g}" for low, high in pairwise(EDGES))
    print(f"| surface, against class | {heads} |\n|---|{'---|' * (len(EDGES) - 1)}")
    surfaces: list[tuple[Surface, str]] = [(Iso8608(c, 1), c) for c in ROUGHNESS]
    for surface, road_class in (*surfaces, (Cobbles(1), "C")):
        figures = " | ".join(f"{ratio:.2f}" for ratio in bands(surface, road_class))
        print(f"| {surface.label}, {road_class} | {figures} |")
    print(
        "\n| surface | speed, km/h | suspension velocity, rms mm/s | a_w, m/s2 |\n|---|---|---|---|"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "surface.yaml"
        path.write_text(SCENARIO, encoding="utf-8")
        for name in (*ROUGHNESS, "cobbles"):
            for speed in SPEEDS_KMH:
                scenario = load(path, [f"road.surface={name}", f"driver.speed_kmh={speed}"])
                assembly = assemble(scenario, scenario.controllers[0], NoSensor())
                ride = assembly.run(None).comfort["weighted_acceleration_m_s2"]
                truth = 1e3 * rms(assembly.recorder.group("truth"))
                print(f"| {name} | {speed} | {truth:.0f} | {ride:.2f} |")


if __name__ == "__main__":
    main()
