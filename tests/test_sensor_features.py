"""Residuals of the wheel speeds: zero for a car that only drives."""

from __future__ import annotations

import numpy as np
import pytest

from sensor.body_motion import Geometry
from sensor.channels import CHANNEL_NAMES
from sensor.features import WHEEL_SPEEDS, Slip, WheelSpeedResiduals, residuals, with_residuals

INDEX = {name: i for i, name in enumerate(CHANNEL_NAMES)}


def sample(**values: float) -> np.ndarray:
    row = np.zeros((1, 14))
    for name, value in values.items():
        row[0, INDEX[f"Car.{name}"]] = value
    return row


def test_a_rigid_car_on_a_circle_has_none() -> None:
    """Wheel speeds from rigid-body kinematics (the oracle): steered front wheels, no slip."""
    g, vx, yaw = Geometry(), 12.0, 0.3
    places = [(x, y) for x in (g.front_x, g.rear_x) for y in (g.left_y, g.right_y)]
    rear_axle = -yaw * g.rear_x  # v_y of the centre of gravity: the rear axle runs straight
    row = sample(vx=vx, YawRate=yaw)
    for wheel, (x, y) in zip(("FL", "FR", "RL", "RR"), places, strict=True):
        velocity = np.array([vx - yaw * y, rear_axle + yaw * x])
        row[0, INDEX[f"Car.v{wheel}"]] = np.hypot(*velocity)
        if wheel in ("FL", "FR"):
            row[0, INDEX[f"Car.SteerAngle{wheel}"]] = np.arctan2(velocity[1], velocity[0])
    rolling = WheelSpeedResiduals(slip=Slip(0.0, 0.0, 0.0, 0.0))
    assert rolling.apply(row) == pytest.approx(np.zeros((1, 4)), abs=1e-12)


def test_slip_of_braking_and_of_load_transfer() -> None:
    s, vx = Slip(), 20.0
    row = sample(vx=vx, ax=-4.0, ay=5.0)
    for wheel, axle in (("FL", s.front), ("FR", s.front), ("RL", s.rear), ("RR", s.rear)):
        side = -1.0 if wheel.endswith("L") else 1.0
        speed = vx * (1.0 + axle - 4.0 * s.per_ax + side * 5.0 * s.per_ay)
        row[0, INDEX[f"Car.v{wheel}"]] = speed
    assert residuals(row) == pytest.approx(np.zeros((1, 4)), abs=1e-12)


def test_a_spinning_wheel_is_clipped() -> None:
    row = sample(vx=10.0, vFL=14.0, vFR=2.0, vRL=10.0, vRR=10.0)
    assert residuals(row)[0, :2] == pytest.approx([Slip().limit, -Slip().limit])


def test_steps_are_the_run() -> None:
    random = np.random.default_rng(4)
    channels = random.normal(size=(50, 14))
    channels[:, WHEEL_SPEEDS] = 10.0 + random.normal(scale=0.1, size=(50, 4))
    channels[:, INDEX["Car.vx"]] = 10.0
    block, whole = WheelSpeedResiduals(), residuals(channels)
    assert all(
        np.array_equal(block.step(row), want) for row, want in zip(channels, whole, strict=True)
    )
    replaced = with_residuals(channels)
    assert np.array_equal(replaced[:, WHEEL_SPEEDS], whole)
    assert np.array_equal(replaced[:, :9], channels[:, :9])
