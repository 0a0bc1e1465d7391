"""The linear car on tyres with lateral grip: relaxation, trail, rack and bushings, gyroscopes.

Adds to the ten coordinates of `vehicle_linear` the rack angle, the four compliance steer angles and
the four lateral carcass deflections, all as complex amplitudes at one frequency. Longitudinal
forces are left out: they hardly couple with what is looked at here.
"""

from __future__ import annotations

import numpy as np
from vehicle_linear import ROLL, TRAVEL, YAW, Complex, LinearCar, Y, per_corner
from vehicle_rig import Array, parameter

RACK, COMPLIANCE, STRETCH, SIZE = 10, 11, 15, 19
BODY = slice(0, 10)


def cornering_stiffness(loads: Array) -> Array:
    """Magic Formula (PAC2002): dFy/d(tan alpha) at zero slip [N], positive."""
    nominal = parameter("Tire.NominalLoad")
    angle = 2.0 * np.arctan(loads / (parameter("Tire.PKY2") * nominal))
    return np.asarray(-parameter("Tire.PKY1") * nominal * np.sin(angle))


def relaxation_length(loads: Array) -> Array:
    """PAC2002 lateral relaxation length [m]."""
    angle = 2.0 * np.arctan(loads / (parameter("Tire.PTY2") * parameter("Tire.NominalLoad")))
    return np.asarray(parameter("Tire.PTY1") * np.sin(angle) * parameter("Tire.Radius"))


def pneumatic_trail(loads: Array) -> Array:
    """PAC2002 trail at zero slip [m]."""
    factor = parameter("Tire.QDZ1") * parameter("Tire.Radius")
    return np.asarray(factor * loads / parameter("Tire.NominalLoad"))


class GripCar:
    """`response` as that of `LinearCar`, at a driving speed [m/s]."""

    def __init__(self, car: LinearCar, speed: float) -> None:
        self.car, self.speed = car, speed
        self.stiffness = cornering_stiffness(car.loads)
        self.relaxation = relaxation_length(car.loads)
        self.trail = pneumatic_trail(car.loads)
        self.caster = per_corner("Kin.Caster@")
        self.momentum = parameter("Wheel.Inertia") * speed / parameter("Wheel.KinematicRadius")

    def response(self, omega: float, road: Array | Complex, slope: Array | Complex) -> Complex:
        """Complex p (10,) to the road's complex elevation and slope under each wheel, (4,) each."""
        s, car = 1j * omega, self.car
        A = np.zeros((SIZE, SIZE), dtype=np.complex128)
        A[BODY, BODY] = car.dynamic_stiffness(omega)
        A[RACK, RACK] = parameter("Steer.Stiffness") + s * parameter("Steer.Damping")
        for i in range(4):
            self._add_wheel(A, s, i)
        b = np.zeros(SIZE, dtype=np.complex128)
        b[BODY] = car.road_force(omega, road, slope)
        return np.asarray(np.linalg.solve(A, b)[BODY])

    def _rows(self, i: int) -> tuple[Complex, Complex, Complex, Complex]:
        """Rows for a wheel: contact point's lateral place without and with steer, heading, lean."""
        car, q = self.car, TRAVEL + i
        down = np.array([0.0, 0.0, -car.radius[i]])
        contact = car.hub[i] + down
        place, heading, lean = (np.zeros(SIZE, dtype=np.complex128) for _ in range(3))
        place[Y], place[ROLL], place[YAW] = 1.0, -contact[2], contact[0]
        place[q] = (car.path[i] + np.cross(car.turn[i], down))[1]
        heading[YAW], heading[q], heading[COMPLIANCE + i] = 1.0, car.turn[i, 2], 1.0
        heading[RACK] = i < 2
        lean[ROLL], lean[q] = 1.0, car.turn[i, 0]
        steered = place.copy()
        scrub = -car.radius[i] * np.sin(self.caster[i])  # the contact lies behind the kingpin
        steered[COMPLIANCE + i] = scrub
        steered[RACK] = scrub * (i < 2)
        return place, steered, heading, lean

    def _add_wheel(self, A: Complex, s: complex, i: int) -> None:
        car, q, e = self.car, TRAVEL + i, STRETCH + i
        place, steered, heading, lean = self._rows(i)
        # d(stretch)/dt = -V_sy - V/sigma * stretch, V_sy = d(place)/dt - V * heading
        A[e] += s * steered - self.speed * heading
        A[e, e] += s + self.speed / self.relaxation[i]
        carcass = self.stiffness[i] / self.relaxation[i]
        force, moment = (np.zeros(SIZE, dtype=np.complex128) for _ in range(2))
        force[e] = carcass + parameter("Tire.CarcassDampingY") * s
        moment[e] = -self.trail[i] * carcass
        A[BODY] -= np.outer(place[BODY], force)
        turn = self.momentum * s
        A[YAW] -= moment - turn * lean  # dH/dt of the spinning wheels: about x from heading,
        A[ROLL] -= turn * heading  # about z from inclination
        A[q] -= car.turn[i, 2] * (moment - turn * lean) + car.turn[i, 0] * turn * heading
        bushing = per_corner("Kin.LateralForceSteer@")[i]
        A[COMPLIANCE + i, COMPLIANCE + i] += 1.0 + s * parameter("Kin.ComplianceLag")
        A[COMPLIANCE + i] -= bushing * force
        if i < 2:
            lever = car.radius[i] * np.sin(self.caster[i])
            A[RACK] -= moment * np.cos(self.caster[i]) - lever * (force + car.loads[i] * lean)
