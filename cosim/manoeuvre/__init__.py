"""Manoeuvres: what is driven on a road, and the figures that tell how well it was driven."""

from __future__ import annotations

import math

from cosim.manoeuvre.constant import ConstantRadius, ConstantSpeed
from cosim.manoeuvre.evasive import DoubleLaneChange, Slalom
from cosim.manoeuvre.follow import FollowRoad
from cosim.manoeuvre.gates import Body
from cosim.manoeuvre.mix import FASTEST_MIX, Mix
from cosim.manoeuvre.motion import Motion, motion_of
from cosim.manoeuvre.open_loop import SineWithDwell, StepSteer
from cosim.manoeuvre.plan import RUN_UP_S, Manoeuvre, Plan
from cosim.manoeuvre.slalom import Cones
from cosim.manoeuvre.straight import SpeedChange
from cosim.scenario import manoeuvre as settings
from cosim.scenario.schema import Scenario
from cosim.speed_profile import STYLES, careful


def manoeuvre_of(scenario: Scenario, step_s: float) -> Manoeuvre:
    """Return the scenario's manoeuvre; commands are given every `step_s` [s].

    Without one the driver follows the road within the limits of his style.
    """
    wanted, kmh = scenario.manoeuvre, scenario.driver.speed_kmh
    if wanted is None:
        style = careful(STYLES[scenario.driver.style], friction_of(scenario))
        return FollowRoad(style, None if kmh is None else kmh / 3.6)
    if isinstance(wanted, settings.Mix):
        seed = scenario.seed if wanted.seed is None else wanted.seed
        return Mix(seed, (FASTEST_MIX if kmh is None else kmh) / 3.6, friction_of(scenario))
    if kmh is None:
        raise ValueError("a manoeuvre needs driver.speed_kmh")  # refused when the file was read
    speed = kmh / 3.6
    if isinstance(wanted, settings.ConstantSpeed):
        return ConstantSpeed(speed)
    if isinstance(wanted, settings.ConstantRadius):
        return ConstantRadius(speed)
    start = RUN_UP_S * speed if wanted.start_m is None else wanted.start_m
    if isinstance(wanted, settings.DoubleLaneChange):
        return DoubleLaneChange(speed, start, body_of(scenario), scenario.road.friction)
    if isinstance(wanted, settings.Slalom):
        cones = Cones(max(start, wanted.spacing_m), wanted.spacing_m, wanted.cones)
        return Slalom(speed, cones, wanted.clearance_m, body_of(scenario))
    if isinstance(wanted, settings.Brake):
        rate = None if wanted.deceleration_m_s2 is None else -wanted.deceleration_m_s2
        pedal = None if wanted.pedal is None else -wanted.pedal
        friction = friction_of(scenario)
        return SpeedChange(speed, wanted.to_kmh / 3.6, start, step_s, rate, pedal, friction)
    if isinstance(wanted, settings.Accelerate):
        rate, pedal, friction = wanted.acceleration_m_s2, wanted.pedal, friction_of(scenario)
        return SpeedChange(speed, wanted.to_kmh / 3.6, start, step_s, rate, pedal, friction)
    angle = math.radians(wanted.amplitude_deg) * (1.0 if wanted.direction == "left" else -1.0)
    if isinstance(wanted, settings.SineWithDwell):
        return SineWithDwell(speed, start, angle, wanted.frequency_hz, wanted.dwell_s, step_s)
    return StepSteer(speed, start, angle, wanted.rise_s, step_s)


def friction_of(scenario: Scenario) -> float:
    """Return the road's friction, 1 on dry asphalt."""
    return 1.0 if scenario.road.friction is None else scenario.road.friction


def body_of(scenario: Scenario) -> Body:
    """Return the outline of the scenario's vehicle."""
    outline = scenario.vehicle.outline
    left = 0.5 * outline.width_m if outline.left_m is None else outline.left_m
    return Body(outline.front_m, outline.rear_m, left, outline.width_m - left)


__all__ = ["Body", "Manoeuvre", "Motion", "Plan", "friction_of", "manoeuvre_of", "motion_of"]
