"""What a driver knows of his car: how it steers, drives and brakes."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class DriverModel:
    """A single-track car whose tyres saturate, and its pedals. SI units.

    The slip angles per lateral acceleration, `understeer` (front less rear, at the road wheels) and
    `rear_slip`, grow by 1 / (1 - (ay / saturation)^2.5): fitted to the package's vehicle in steady
    bends of 30 to 200 m up to 7.9 m/s2, within 5 %. Another car only costs the feed-forward some
    accuracy.
    """

    wheelbase: float = 2.675
    cog_to_rear: float = 1.236
    steering_ratio: float = 16.5
    understeer: float = 0.0029  # rad per m/s2
    rear_slip: float = 0.0058  # rad per m/s2
    saturation: float = 10.8  # m/s2
    largest_steer: float = 0.55  # at the road wheels [rad]
    mass: float = 2520.0  # with the rotating parts' inertia
    drive_force: float = 19700.0  # at full accelerator [N]
    drive_power: float = 267e3  # [W]
    brake_force: float = 28500.0  # at full pedal [N]
    drag: float = 0.546  # N per (m/s)^2
    rolling: float = 240.0  # N
    preview_time: float = 0.13  # curvature preview: rack and tyre lags [s]
    correction_time: float = 0.6  # look-ahead of the correction [s]
    correction_distance: float = 4.0  # its minimum [m]
    learning_time: float = 3.0  # of the understeer in bends beyond `learning_from` [s]
    learning_from: float = 5.5  # m/s2, more than any driving style
    pedal_lag: float = 0.15  # [s]
    speed_gain: float = 1.0  # 1/s
    speed_integral: float = 0.15  # 1/s^2
    creep_speed: float = 0.7  # up to a stop line [m/s]

    def on(self, friction: float) -> DriverModel:
        """Return the same car on a road of another friction, 1 being dry asphalt."""
        return replace(self, saturation=friction * self.saturation)

    def slip_growth(self, lateral_acceleration: float) -> float:
        """Return how much larger the slip angles are than on tyres without an end to their grip."""
        share = min(abs(lateral_acceleration) / self.saturation, 0.85)
        return float(1.0 / (1.0 - share**2.5))

    def steady_steer(self, v: float, curvature: float) -> float:
        """Return the road-wheel angle [rad] of a steady bend of `curvature` [1/m] at v [m/s]."""
        growth = self.slip_growth(v * v * curvature)
        return (self.wheelbase + self.understeer * growth * v * v) * curvature

    def steady_side_slip(self, v: float, curvature: float) -> float:
        """Return the side slip angle [rad] at the centre of gravity in a steady bend."""
        growth = self.slip_growth(v * v * curvature)
        return (self.cog_to_rear - self.rear_slip * growth * v * v) * curvature

    def resistance(self, v: float, curvature: float) -> float:
        """Return what holds the car back on the level at steady speed [N], in a bend the tyres' own
        slip angles too.
        """
        lateral = v * v * curvature
        front_share = self.cog_to_rear / self.wheelbase
        slip = (self.rear_slip + front_share * self.understeer) * self.slip_growth(lateral)
        return self.drag * v * v + self.rolling + self.mass * slip * lateral * lateral

    def pedals(self, force: float, v: float) -> tuple[float, float]:
        """Return accelerator and brake (0..1) for a force at the wheels [N], forward positive."""
        if force >= 0:
            return min(force / min(self.drive_force, self.drive_power / max(v, 1.0)), 1.0), 0.0
        return 0.0, min(-force / self.brake_force, 1.0)
