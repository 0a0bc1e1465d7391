"""The car's small motions: an independent linearisation of the vehicle, from its parameters alone.

Ten coordinates p = (x, y, z, roll, pitch, yaw of the whole car's centre of gravity, four wheel
travels) about the level car at rest. Stiffness is the Hessian of the potential energy (gravity,
springs, bars, tyres), inertia follows from the whole vehicle's mass and inertias plus the carriers'
paths. The tyres stand on a road without grip, which makes the system holonomic. Signs: ISO 8855,
travel positive in compression.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt
from vehicle_rig import CORNERS, Array, G, parameter

Complex = npt.NDArray[np.complex128]

X, Y, Z, ROLL, PITCH, YAW, TRAVEL = 0, 1, 2, 3, 4, 5, 6
SIDE = np.array([1.0, -1.0, 1.0, -1.0])  # left, right


def per_corner(pattern: str) -> Array:
    """The start values of one parameter at the four corners ("@" is the corner)."""
    return np.array([parameter(pattern.replace("@", c)) for c in CORNERS])


def rotation(axis: int, angle: float) -> Array:
    """Rotation matrix about one axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i] = R[j, j] = np.cos(angle)
    R[j, i], R[i, j] = np.sin(angle), -np.sin(angle)
    return R


@dataclass(frozen=True)
class LinearCar:
    """M, C, K and the road's influence; `damping` (4,) at the wheels, `tyre_damping` [N s/m].

    `kinematics` false: the wheels move straight up and do not turn.
    """

    damping: Array = field(default_factory=lambda: np.zeros(4))
    tyre_damping: float = 0.0
    kinematics: bool = True

    @cached_property
    def loads(self) -> Array:
        """Static wheel loads [N], shape (4,)."""
        a, b = parameter("Body.CogToFront"), parameter("Body.CogToRear")
        left, right = parameter("Body.CogToLeft"), parameter("Body.CogToRight")
        share = np.outer([b, a], [right, left]) / ((a + b) * (left + right))
        return np.asarray(parameter("Body.Mass") * G * share.ravel())

    @cached_property
    def radius(self) -> Array:
        """Loaded radii at rest [m], shape (4,)."""
        return np.asarray(parameter("Tire.Radius") - self.loads / parameter("Tire.Stiffness"))

    @cached_property
    def hub(self) -> Array:
        """Wheel centres at rest from the car's centre of gravity [m], shape (4, 3)."""
        a, b = parameter("Body.CogToFront"), -parameter("Body.CogToRear")
        left, right = parameter("Body.CogToLeft"), -parameter("Body.CogToRight")
        z = self.radius - parameter("Body.CogHeight")
        return np.column_stack([[a, a, b, b], [left, right, left, right], z])

    @cached_property
    def track(self) -> float:
        return parameter("Body.CogToLeft") + parameter("Body.CogToRight")

    @cached_property
    def gains(self) -> dict[str, Array]:
        """First and second-order kinematic gains per travel, shape (4,) each."""
        names = (
            "Recession",
            "RecessionCurve",
            "Camber",
            "CamberCurve",
            "KnucklePitch",
            "BumpSteer",
        )
        gains = {n: per_corner(f"Kin.{n}@") * self.kinematics for n in names}
        # the contact point's path sets the roll centre: slope 2 h / track, less what camber does
        height = per_corner("Kin.RollCentre@") * self.kinematics
        gains["Lateral"] = 2.0 * height / self.track - self.radius * gains["Camber"]
        return gains

    @cached_property
    def path(self) -> Array:
        """d(wheel centre)/d(travel) at rest, shape (4, 3)."""
        g = self.gains
        return np.column_stack([-g["Recession"], SIDE * g["Lateral"], np.ones(4)])

    @cached_property
    def turn(self) -> Array:
        """Carrier rotation per travel at rest [rad/m], shape (4, 3)."""
        g = self.gains
        return np.column_stack([SIDE * g["Camber"], g["KnucklePitch"], SIDE * g["BumpSteer"]])

    @cached_property
    def M(self) -> Array:
        """Mass matrix, shape (10, 10)."""
        mass = parameter("Body.UnsprungMass") / 4.0
        spins = 4.0 * parameter("Wheel.Inertia")  # free to turn: no part of the pitch inertia
        across, about = parameter("Wheel.CarrierInertiaX"), parameter("Wheel.CarrierInertiaY")
        inertia = np.diag([across, about, across])
        whole = [parameter("Body.Mass")] * 3
        whole += [parameter(f"Body.Inertia{n}") for n in ("Roll", "Pitch", "Yaw")]
        M = np.zeros((10, 10))
        M[:6, :6] = np.diag(whole)
        M[PITCH, PITCH] -= spins
        for i in range(4):
            path, turn = self.path[i], self.turn[i]
            coupling = np.r_[mass * path, np.cross(self.hub[i], mass * path) + inertia @ turn]
            M[:6, TRAVEL + i] = M[TRAVEL + i, :6] = coupling
            M[TRAVEL + i, TRAVEL + i] = mass * path @ path + turn @ inertia @ turn
        return M

    def _wheel(self, p: Array, i: int) -> tuple[Array, Array]:
        """Wheel centre and axle in the inertial frame."""
        g, q = self.gains, p[TRAVEL + i]
        R = rotation(2, p[YAW]) @ rotation(1, p[PITCH]) @ rotation(0, p[ROLL])
        back = (g["Recession"][i] + g["RecessionCurve"][i] * q) * q
        shift = [-back, SIDE[i] * g["Lateral"][i] * q, q]
        toe = SIDE[i] * g["BumpSteer"][i] * q
        camber = SIDE[i] * (g["Camber"][i] + g["CamberCurve"][i] * q) * q
        axle = R @ rotation(2, toe) @ rotation(0, camber) @ np.array([0.0, 1.0, 0.0])
        return p[:3] + R @ (self.hub[i] + np.array(shift)), axle

    def deflection(self, p: Array, i: int) -> float:
        """Tyre deflection on the level road [m]."""
        centre, axle = self._wheel(p, i)
        height = centre[2] + parameter("Body.CogHeight")
        return float(parameter("Tire.Radius") - height / np.sqrt(1.0 - axle[2] ** 2))

    def potential(self, p: Array) -> float:
        """Potential energy [J]."""
        unsprung = parameter("Body.UnsprungMass") / 4.0
        sprung_mass = parameter("Body.Mass") - 4.0 * unsprung
        offset = -4.0 * unsprung * self.hub.mean(axis=0) / sprung_mass
        R = rotation(2, p[YAW]) @ rotation(1, p[PITCH]) @ rotation(0, p[ROLL])
        energy = sprung_mass * G * (p[Z] + (R @ offset)[2])
        rates = per_corner("Susp.WheelRate@")
        for i in range(4):
            q, d = p[TRAVEL + i], max(self.deflection(p, i), 0.0)
            energy += unsprung * G * self._wheel(p, i)[0][2]
            energy += (self.loads[i] - unsprung * G) * q + 0.5 * rates[i] * q * q
            energy += 0.5 * parameter("Tire.Stiffness") * d * d
        for k, axle in enumerate(("Front", "Rear")):
            twist = (p[TRAVEL + 2 * k] - p[TRAVEL + 2 * k + 1]) / self.track
            energy += 0.5 * parameter(f"Susp.AntiRoll{axle}") * twist**2
        return float(energy)

    def gradient(self) -> Array:
        """dV/dp at rest: zero if the preloads carry the car, shape (10,)."""
        h = 1e-4 * np.eye(10)
        return np.array([(self.potential(e) - self.potential(-e)) / 2e-4 for e in h])

    @cached_property
    def K(self) -> Array:
        """Hessian of the potential energy at rest, shape (10, 10)."""
        h = 1e-3
        e = h * np.eye(10)
        V = self.potential
        K = np.empty((10, 10))
        for a in range(10):
            for b in range(a + 1):
                mixed = V(e[a] + e[b]) - V(e[a] - e[b]) - V(e[b] - e[a]) + V(-e[a] - e[b])
                K[a, b] = K[b, a] = mixed / (4.0 * h * h)
        return K

    @cached_property
    def lift(self) -> Array:
        """d(height of the wheel over the road)/dp, shape (4, 10)."""
        e = 1e-6 * np.eye(10)
        rows = [
            [-(self.deflection(v, i) - self.deflection(-v, i)) / 2e-6 for v in e] for i in range(4)
        ]
        return np.array(rows)

    @cached_property
    def C(self) -> Array:
        """Damping matrix, shape (10, 10)."""
        C = self.tyre_damping * self.lift.T @ self.lift
        C[TRAVEL:, TRAVEL:] += np.diag(self.damping)
        return np.asarray(C)

    def eigenvalues(self) -> Array:
        """Eigenvalues with positive imaginary part, ascending [rad/s]."""
        zero, one = np.zeros((10, 10)), np.eye(10)
        flow = -np.linalg.solve(self.M, np.hstack([self.K, self.C]))
        A = np.vstack([np.hstack([zero, one]), flow])
        values = np.linalg.eigvals(A)
        values = values[values.imag > 1.0]
        return np.asarray(values[np.argsort(values.imag)])

    def steady_turn(self) -> Array:
        """Static p per unit lateral acceleration (to the left), shape (10,).

        Inertia forces on all masses, tyre forces at the contact points (shared by the axles as the
        moments about z ask), and the wheels' gyroscopic moment. What no stiffness holds (x, y, yaw)
        stays zero.
        """
        load = -self.M[:, Y].copy()
        momentum = parameter("Wheel.Inertia") / parameter("Wheel.KinematicRadius")
        for i in range(4):
            down = np.array([0.0, 0.0, -self.radius[i]])
            contact = self.hub[i] + down
            lateral = np.zeros(10)
            lateral[Y], lateral[ROLL], lateral[YAW] = 1.0, -contact[2], contact[0]
            lateral[TRAVEL + i] = (self.path[i] + np.cross(self.turn[i], down))[1]
            load += lateral * (self.loads[2 * (i // 2) :][:2].sum() / (2.0 * G))
            load[ROLL] += momentum
            load[TRAVEL + i] += momentum * self.turn[i, 0]
        held = np.array([Z, ROLL, PITCH, *range(TRAVEL, 10)])
        p = np.zeros(10)
        p[held] = np.linalg.solve(self.K[np.ix_(held, held)], load[held])
        return p

    def dynamic_stiffness(self, omega: float) -> Complex:
        """K + i omega C - omega^2 M, shape (10, 10)."""
        return np.asarray(self.K - omega**2 * self.M + 1j * omega * self.C)

    def road_force(self, omega: float, road: Array | Complex, slope: Array | Complex) -> Complex:
        """Generalised force of the road's complex elevation and slope under each wheel, (4,) each.

        The road pushes with the tyre's spring and damper; its slope turns the static load.
        """
        stiffness = parameter("Tire.Stiffness") + 1j * omega * self.tyre_damping
        force = self.lift.T @ (stiffness * road)
        for i in range(4):
            forward = np.zeros(10)
            forward[X], forward[PITCH] = 1.0, self.hub[i, 2]
            forward[YAW], forward[TRAVEL + i] = -self.hub[i, 1], self.path[i, 0]
            force = force - self.loads[i] * slope[i] * forward
        return np.asarray(force)

    def response(self, omega: float, road: Array | Complex, slope: Array | Complex) -> Complex:
        """Complex p (10,) to the road."""
        force = self.road_force(omega, road, slope)
        return np.asarray(np.linalg.solve(self.dynamic_stiffness(omega), force))
