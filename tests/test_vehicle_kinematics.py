"""Kinematics and compliance curves over wheel travel, and the design values behind them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from gates import Limit, between, gate
from plant_probe import MOTION, Probe
from validation_plots import picture
from vehicle_linear import SIDE, LinearCar
from vehicle_rig import CENTRED, CORNERS, Array, each, parameter, run, steer_to

from cosim.fmi import Value

SECTION = "Kinematics and compliance"
TRAVEL = np.linspace(-0.08, 0.08, 33)  # [m], compression positive
FRONT, REAR = CORNERS.index("FL"), CORNERS.index("RL")
DESIGN = "design value (docs/vehicle.md)"


@dataclass(frozen=True)
class Curves:
    """Of the left wheels over TRAVEL: (n, 4) each; angles toe-in and top-in positive [rad]."""

    toe: Array
    camber: Array
    recession: Array  # rearward [m]
    contact_path: Array  # d(locked contact point)/d(travel), x forward [1]
    lateral_path: Array  # d(contact point)/d(travel), outward [1]


@cache
def curves() -> Curves:
    """From the plant's own kinematics, all four wheels moved together."""
    probe, car = Probe(), LinearCar()
    shape = (len(TRAVEL), 4)
    toe, camber, recession, contact, lateral = (np.zeros(shape) for _ in range(5))
    rest = None
    for n, z in enumerate([0.0, *TRAVEL]):
        motion = np.zeros((), MOTION)
        motion["quaternion"] = [1.0, 0.0, 0.0, 0.0]
        motion["travel"], motion["travel_rate"] = z, 1.0  # rates are then derivatives by travel
        response = probe.multibody(motion)
        if rest is None:
            rest = response["r"].copy()
            continue
        axle, k = response["axle"], n - 1
        toe[k] = SIDE * np.arctan2(axle[:, 0], axle[:, 1])
        camber[k] = -SIDE * np.arcsin(axle[:, 2])  # the wheel's top leans in: negative camber
        recession[k] = rest[:, 0] - response["r"][:, 0]
        down = np.array([0.0, 0.0, -1.0]) * car.radius[:, None]
        foot = response["v"] + np.cross(response["rate"], down)
        contact[k], lateral[k] = foot[:, 0], SIDE * foot[:, 1]
    return Curves(toe, camber, recession, contact, lateral)


def slope(values: Array) -> Array:
    """Derivative by travel at the design position, shape (4,)."""
    middle = len(TRAVEL) // 2
    step = TRAVEL[middle + 1] - TRAVEL[middle - 1]
    return np.asarray((values[middle + 1] - values[middle - 1]) / step)


def near(value: float, tolerance: float) -> Limit:
    return between(round(value - tolerance, 6), round(value + tolerance, 6))


def enter(what: str, values: tuple[float, float], design: tuple[float, float], tol: float) -> None:
    for axle, value, wanted in zip(("front", "rear"), values, design, strict=True):
        gate(SECTION, f"{what}, {axle}", DESIGN, value, near(wanted, tol))


def both(values: Array) -> tuple[float, float]:
    return float(values[FRONT]), float(values[REAR])


def test_kinematics_are_the_design_values() -> None:
    c, per_100_mm = curves(), 0.1
    turned = np.degrees(per_100_mm * slope(c.camber))
    enter("camber gain [deg per 100 mm compression]", both(turned), (-1.5, -2.5), 0.01)
    turned = np.degrees(per_100_mm * slope(c.toe))
    enter("bump steer, toe-in positive [deg per 100 mm]", both(turned), (-0.3, 0.2), 0.005)
    moved = 1e3 * per_100_mm * slope(c.recession)
    enter("wheel recession [mm per 100 mm]", both(moved), (5.0, 12.0), 0.05)
    height = 1e3 * 0.5 * LinearCar().track * c.lateral_path[len(TRAVEL) // 2]
    enter("roll centre height [mm]", both(height), (80.0, 140.0), 1.0)


def test_anti_dive_and_anti_lift_of_the_geometry() -> None:
    """Share of the load transfer that the brake forces' inclined contact paths carry."""
    path = curves().contact_path[len(TRAVEL) // 2]
    wheelbase = parameter("Body.CogToFront") + parameter("Body.CogToRear")
    share = parameter("Brake.FrontShare")
    lever = wheelbase / parameter("Body.CogHeight")
    dive, lift = 100.0 * path[FRONT] * share * lever, -100.0 * path[REAR] * (1.0 - share) * lever
    gate(SECTION, "anti-dive, front [%]", DESIGN, float(dive), near(25.0, 0.5))
    gate(SECTION, "anti-lift, rear [%]", DESIGN, float(lift), near(35.0, 0.5))


def test_left_and_right_mirror_each_other() -> None:
    c = curves()
    for values in (c.toe, c.camber, c.recession):
        assert values[:, [1, 3]] == pytest.approx(values[:, [0, 2]], abs=1e-12)
    for values in (c.contact_path, c.lateral_path):  # the loaded radii differ by 2 mm
        assert values[:, [1, 3]] == pytest.approx(values[:, [0, 2]], abs=2e-3)


def test_lateral_force_steer() -> None:
    """Steady turn of the FMU: steer angles behind a rigid rack over the tyres' lateral forces."""
    rigid: dict[str, Value] = {
        **CENTRED, "Steer.Stiffness": 1e6, "Steer.Damping": 2000.0, "Steer.Ackermann": 0.0,
        "Tire.QDZ1": 0.0, **each("Kin.Caster@", 0.0),
    }  # fmt: skip
    angle = 0.8
    record = run(5.0, {"Init.Velocity": 25.0, **rigid}, steer_to(angle, 0.5))
    force = record.corners("Car.Fy@")[400:].mean(axis=0) / 1e3
    steer = np.degrees(record.corners("Car.SteerAngle@")[400:].mean(axis=0))
    steer[:2] -= np.degrees(angle / parameter("Steer.Ratio"))
    measured = steer.reshape(2, 2).sum(axis=1) / force.reshape(2, 2).sum(axis=1)
    # less steer in front, with the force at the rear: both understeer
    enter("lateral-force steer [deg/kN]", (measured[0], measured[1]), (-0.03, 0.01), 0.001)


@pytest.mark.validation
def test_picture_of_kinematics(plots: Path) -> None:
    caption = (
        "Kinematics over wheel travel (compression positive): camber, toe, recession, and the "
        "slope of the contact point's path with the wheel locked, which carries brake force. "
        "Dashed: the design gains at the design position."
    )
    c = curves()
    panels = (
        ("camber, deg", np.degrees(c.camber), (-1.5, -2.5)),
        ("toe-in, deg", np.degrees(c.toe), (-0.3, 0.2)),
        ("recession, mm", 1e3 * c.recession, (5.0, 12.0)),
        ("locked contact path, mm/mm", c.contact_path, None),
    )
    with picture(plots, SECTION, "kinematics", caption, ncols=4, figsize=(11, 3.4),
                 sharey=True) as (_, axes):  # fmt: skip
        for ax, (label, values, gains) in zip(axes, panels, strict=True):
            for k, (corner, name) in enumerate(((FRONT, "front"), (REAR, "rear"))):
                ax.plot(values[:, corner], 1e3 * TRAVEL, f"C{k}", label=name)
                if gains:
                    ax.plot(gains[k] * TRAVEL / 0.1, 1e3 * TRAVEL, f"C{k}--", lw=0.8)
            ax.set_xlabel(label)
        axes[0].set_ylabel("wheel travel, mm")
        axes[0].legend()
