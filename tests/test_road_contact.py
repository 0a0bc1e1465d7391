"""What the vehicle's contact points meet of stones and obstacles, against ASAM's reader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycrg
import pytest
from gates import at_most, gate

from cosim.fmi import Description, Slave
from cosim.road import Bumps, Cobbles, Obstacle, Pothole, Smooth, build_road, load_track
from cosim.road.surface import Surface
from cosim.vehicle import builtin_fmu

H = 0.01
PLACES = {"FL": (1.439, 0.778), "FR": (1.439, -0.847), "RL": (-1.236, 0.778)}
# the patch's points: 4 along over 0.11 m, 2 across 0.12 m apart
PATCH = [(s, t) for s in (-0.04125, -0.01375, 0.01375, 0.04125) for t in (-0.06, 0.06)]


def drive(road: Path, speed: float, steps: int) -> dict[str, np.ndarray]:
    outputs = ["Car.tx", "Car.ty", "Car.Pitch", *(f"Car.zRoad{corner}" for corner in PLACES)]
    slave = Slave(Description(builtin_fmu()), [], outputs)
    try:
        slave.initialise({"Road.File": str(road), "Init.Velocity": speed})
        rows = np.empty((steps, len(outputs)))
        for k in range(steps):
            slave.read()
            rows[k] = slave.outputs
            slave.step(k, H)
    finally:
        slave.close()
    return dict(zip(outputs, rows.T, strict=True))


@pytest.mark.parametrize(
    ("surface", "obstacles", "exact"),
    [
        (Cobbles(3), [], 1.5e-3),
        (Smooth(), [Pothole(30.0, 0.05, 0.6, 0.6)], 2e-3),
        (Smooth(), [Bumps(0.02, 0.4, 3.0)], 1e-3),
    ],
    ids=["cobbles", "pothole", "bumps"],
)
def test_the_wheels_meet_the_patch_average(
    tmp_path: Path, surface: Surface, obstacles: list[Obstacle], exact: float
) -> None:
    """But for millimetres of the wheel's own way: travel, recession and pitch move its foot."""
    road = build_road(load_track("straight", 60.0), surface, tmp_path, obstacles)
    run = drive(road, 8.0, 500)
    with pycrg.DataSet.open(road, check=True) as data:
        point = data.create_contact_point()
        for corner, (ahead, left) in PLACES.items():
            at = zip(run["Car.tx"] + ahead, run["Car.ty"] + left, strict=True)
            oracle = np.array(
                [np.mean([point.uv_to_z(x + s, y + t) for s, t in PATCH]) for x, y in at]
            )
            found = run[f"Car.zRoad{corner}"]
            assert oracle.std() > 0.002
            kind = obstacles[0].name if obstacles else surface.label
            off = float(np.sqrt(np.mean((found - oracle) ** 2)))
            check = f"{kind} at 8 m/s, contact height {corner} of the FMU, rms of the error [m]"
            gate("Roads", check, "mean over the patch by ASAM's C API", off, at_most(exact))
            assert np.corrcoef(found, oracle)[0, 1] > 0.97


def test_both_axles_meet_the_whole_depth(tmp_path: Path) -> None:
    hole = Pothole(30.0, 0.05, 0.6, 0.6, "left")
    road = build_road(load_track("straight", 60.0), Smooth(), tmp_path, [hole])
    run = drive(road, 8.0, 500)
    assert run["Car.zRoadFL"].min() == pytest.approx(-0.05, abs=1e-4)
    assert run["Car.zRoadRL"].min() == pytest.approx(-0.05, abs=1e-4)
    assert not run["Car.zRoadFR"].any()
