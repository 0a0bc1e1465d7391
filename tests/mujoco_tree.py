"""The vehicle as a MuJoCo tree, built from its parameters alone: oracle of the plant's equations.

A free sprung body; each carrier hangs on it by three slides and the hinges toe, camber, knuckle
pitch and kingpin; each wheel turns on its carrier. The carrier's joint coordinates are functions of
travel z and steer angle, so MuJoCo's equations of motion are projected on the vehicle's own
coordinates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import mujoco
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

CORNERS = ("FL", "FR", "RL", "RR")
JOINTS = 7  # of a carrier: x, y, z, toe, camber, pitch, kingpin
# Any split of a corner between its bodies must do.
STRUT_MASS_SHARE, WHEEL_MASS_SHARE, WHEEL_INERTIA_SHARE = 0.1, 0.6, 0.625
NO_INERTIA = 1e-14  # kg m2, the least that MuJoCo takes


class Sprung(NamedTuple):
    mass: float
    cog: Array  # from the whole vehicle's centre of gravity
    inertia: Array  # principal moments


def hubs(p: dict[str, float]) -> Array:
    """Wheel centres at zero travel from the whole vehicle's centre of gravity, shape (4, 3)."""
    a, b = p["Body.CogToFront"], p["Body.CogToRear"]
    left, right = p["Body.CogToLeft"], p["Body.CogToRight"]
    points = []
    for corner in CORNERS:
        along = (b if corner[0] == "F" else a) / (a + b)
        across = (right if corner[1] == "L" else left) / (left + right)
        load = p["Body.Mass"] * p["Env.Gravity"] * along * across
        loaded = p["Tire.Radius"] * p[f"Wheel.RadiusScale{corner}"] - load / p["Tire.Stiffness"]
        x, y = a if corner[0] == "F" else -b, left if corner[1] == "L" else -right
        points.append((x, y, loaded - p["Body.CogHeight"]))
    return np.array(points)


def shifted(mass: float, r: Array) -> Array:
    """Inertia of a point mass, shape (3, 3)."""
    return mass * (float(r @ r) * np.eye(3) - np.outer(r, r))


def sprung_body(p: dict[str, float]) -> Sprung:
    """Table 1's vehicle without its four corners."""
    points, corner_mass = hubs(p), p["Body.UnsprungMass"] / 4
    mass = p["Body.Mass"] - p["Body.UnsprungMass"]
    cog = -corner_mass * points.sum(axis=0) / mass
    whole = np.diag([p["Body.InertiaRoll"], p["Body.InertiaPitch"], p["Body.InertiaYaw"]])
    across = p["Wheel.CarrierInertiaX"]
    own = np.diag([across, p["Wheel.CarrierInertiaY"] + p["Wheel.Inertia"], across])
    rest = whole - shifted(mass, cog) - sum(shifted(corner_mass, r) + own for r in points)
    load = np.array([p["Load.X"], p["Load.Y"], p["Load.Z"]])
    both = mass + p["Load.Mass"]
    centre = (mass * cog + p["Load.Mass"] * load) / both
    own_load = np.diag([p["Load.InertiaRoll"], p["Load.InertiaPitch"], p["Load.InertiaYaw"]])
    loaded = rest + shifted(mass, cog - centre) + shifted(p["Load.Mass"], load - centre)
    carried = loaded + own_load if p["Load.Mass"] > 0 else rest
    return Sprung(both, centre, np.diag(carried).copy())


def tree(p: dict[str, float]) -> Any:
    """The compiled MuJoCo model."""
    spec, body = mujoco.MjSpec(), sprung_body(p)
    spec.option.gravity = [0.0, 0.0, -p["Env.Gravity"]]
    spec.compiler.degree = False
    sprung = spec.worldbody.add_body(
        name="sprung", mass=body.mass, inertia=body.inertia, ipos=np.zeros(3), explicitinertial=True
    )
    sprung.add_freejoint()
    mass, across = p["Body.UnsprungMass"] / 4, p["Wheel.CarrierInertiaX"]
    J, wheel_across = p["Wheel.Inertia"], WHEEL_INERTIA_SHARE * across
    carrier_across = across - wheel_across
    for corner, hub in zip(CORNERS, hubs(p) - body.cog, strict=True):
        strut = (
            sprung.add_body(  # at most six joints to a body: the kingpin's hinge is the next one's
                pos=hub,
                mass=STRUT_MASS_SHARE * mass,
                inertia=[NO_INERTIA] * 3,
                ipos=np.zeros(3),
                explicitinertial=True,
            )
        )
        for axis in np.eye(3):
            strut.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        for axis in np.eye(3)[[2, 0, 1]]:
            strut.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis)
        carrier = strut.add_body(
            name=f"carrier{corner}",
            mass=(1 - STRUT_MASS_SHARE - WHEEL_MASS_SHARE) * mass,
            inertia=[carrier_across, p["Wheel.CarrierInertiaY"], carrier_across],
            ipos=np.zeros(3),
            explicitinertial=True,
        )
        caster = p[f"Kin.Caster{corner}"]
        kingpin = [-math.sin(caster), 0.0, math.cos(caster)]
        carrier.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=kingpin)
        wheel = carrier.add_body(
            name=f"wheel{corner}",
            mass=WHEEL_MASS_SHARE * mass,
            inertia=[wheel_across, J, wheel_across],
            ipos=np.zeros(3),
            explicitinertial=True,
        )
        wheel.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    for joint in spec.joints:  # toe and kingpin may be parallel, which compiling would warn of
        joint.armature = 1.0
    model = spec.compile()
    model.dof_armature[:] = 0.0
    return model


class Guided(NamedTuple):
    """A carrier's six guided joint coordinates and their derivatives by travel."""

    value: Array
    first: Array
    second: Array


def guided(p: dict[str, float], corner: str, z: float) -> Guided:
    """Slides x, y, z and the hinges toe, camber, pitch at travel z; left wheels' signs mirrored."""
    side = 1.0 if corner[1] == "L" else -1.0
    track = p["Body.CogToLeft"] + p["Body.CogToRight"]
    loaded = hubs(p)[CORNERS.index(corner), 2] + p["Body.CogHeight"]
    lateral = 2 * p[f"Kin.RollCentre{corner}"] / track - loaded * p[f"Kin.Camber{corner}"]
    polynomials = [  # constant, linear, quadratic
        (0.0, -p[f"Kin.Recession{corner}"], -p[f"Kin.RecessionCurve{corner}"]),
        (0.0, side * lateral, 0.0),
        (0.0, 1.0, 0.0),
        (-side * p[f"Kin.Toe{corner}"], side * p[f"Kin.BumpSteer{corner}"], 0.0),
        tuple(
            side * p[f"Kin.{name}{corner}"] for name in ("StaticCamber", "Camber", "CamberCurve")
        ),
        (0.0, p[f"Kin.KnucklePitch{corner}"], 0.0),
    ]
    c = np.array(polynomials)
    return Guided(c @ [1.0, z, z * z], c @ [0.0, 1.0, 2 * z], c @ [0.0, 0.0, 2.0])


def steer_angle(p: dict[str, float], corner: str, rack: float, compliance: float) -> float:
    """Angle about the kingpin: Ackermann's share in front, compliance everywhere."""
    if corner[0] == "R":
        return compliance
    side = 1.0 if corner[1] == "L" else -1.0
    track = p["Body.CogToLeft"] + p["Body.CogToRight"]
    wheelbase = p["Body.CogToFront"] + p["Body.CogToRear"]
    gain = side * p["Steer.Ackermann"] * track / (2 * wheelbase)
    return rack + gain * rack * rack + compliance


@dataclass(frozen=True)
class Answer:
    """What MuJoCo says; body axes, SI."""

    acceleration: Array
    angular_acceleration: Array
    travel_acceleration: Array
    spin_acceleration: Array  # absolute, about the wheel axes
    kinetic_energy: float
    r: Array  # wheel centres from the reference point
    v: Array
    rate: Array
    axle: Array


class Oracle:
    """MuJoCo's tree of one parameterisation."""

    def __init__(self, parameters: dict[str, float]) -> None:
        self.p = parameters
        self.model = tree(parameters)
        self.data = mujoco.MjData(self.model)

    def _columns(self, i: int) -> slice:
        start = 6 + i * (JOINTS + 1)
        return slice(start, start + JOINTS)

    def _place(self, m: Any) -> tuple[Array, Array]:
        """Set MuJoCo's state; returns J (nv, 14) and the joint accelerations without unknowns."""
        model, data = self.model, self.data
        J, free = np.zeros((model.nv, 14)), np.zeros(model.nv)
        data.qpos[:7] = [0, 0, 0, *m["quaternion"]]
        R = np.zeros(9)
        mujoco.mju_quat2Mat(R, np.array(m["quaternion"]))
        data.qvel[:3], data.qvel[3:6] = R.reshape(3, 3) @ m["velocity"], m["rate"]
        J[:6, :6] = np.eye(6)
        for i, corner in enumerate(CORNERS):
            joints, zd = self._columns(i), m["travel_rate"][i]
            g = guided(self.p, corner, m["travel"][i])
            steer = steer_angle(self.p, corner, float(m["rack"]), m["compliance"][i])
            data.qpos[joints.start + 1 : joints.stop + 1] = [*g.value, steer]
            data.qvel[joints] = [*(g.first * zd), m["steer_rate"][i]]
            data.qvel[joints.stop] = 0.0
            J[joints, 6 + i] = [*g.first, 0.0]
            free[joints] = [*(g.second * zd * zd), 0.0]
            J[joints.stop, 10 + i] = 1.0
        return J, free

    def _update(self) -> None:
        """Everything that follows from position and velocity, short of factorising M."""
        for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_crb, mujoco.mj_comVel):
            stage(self.model, self.data)

    def _carrier_velocities(self, R: Array) -> tuple[Array, Array]:
        """Wheel-centre and angular velocities of the carriers, body axes, shape (4, 3) each."""
        both = np.zeros((4, 6))
        for i, body in enumerate(self._bodies("carrier")):
            mujoco.mj_objectVelocity(
                self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, body, both[i], 0
            )
        return both[:, 3:] @ R, both[:, :3] @ R

    def _bodies(self, kind: str) -> list[int]:
        return [self.model.body(f"{kind}{corner}").id for corner in CORNERS]

    def _applied(self, m: Any, R: Array, brake: Array) -> Array:
        """Generalised force of the wrenches on body and wheels and of the brakes, shape (nv,)."""
        total = np.zeros(self.model.nv)
        places = [self.model.body("sprung").id, *self._bodies("wheel")]
        forces = [m["body_force"], *m["force"]]
        moments = [m["body_moment"], *m["moment"]]
        for body, force, moment in zip(places, forces, moments, strict=True):
            point = self.data.xipos[body].copy()
            mujoco.mj_applyFT(self.model, self.data, R @ force, R @ moment, point, body, total)
        for i in range(4):
            total[self._columns(i).stop] -= brake[i]
        return total

    def _mass(self) -> Array:
        """Mass matrix of the tree, shape (nv, nv)."""
        M, unit = np.zeros((self.model.nv, self.model.nv)), np.eye(self.model.nv)
        for row, column in zip(M, unit, strict=True):
            mujoco.mj_mulM(self.model, self.data, row, column)
        return M

    def locked_inertia(self) -> tuple[Array, Array]:
        """The last solved pose as one rigid body: 6x6 matrix about its centre of gravity, and that.

        The centre counts from the reference point; inertial axes.
        """
        M = self._mass()[:6, :6]
        lever = M[3:, :3] / M[0, 0]  # [cog]x
        cog = np.array([lever[2, 1], lever[0, 2], lever[1, 0]])
        M[3:, 3:] -= shifted(float(M[0, 0]), cog)
        return M, cog

    def _spin_accelerations(self, R: Array, joints: Array, axle: Array) -> Array:
        """Absolute angular accelerations of the wheels about their axles, shape (4,)."""
        self.data.qacc[:] = joints
        mujoco.mj_rnePostConstraint(self.model, self.data)
        both = np.zeros((4, 6))
        for i, body in enumerate(self._bodies("wheel")):
            mujoco.mj_objectAcceleration(
                self.model, self.data, mujoco.mjtObj.mjOBJ_BODY, body, both[i], 0
            )
        accelerations: Array = np.einsum("ij,ij->i", both[:, :3] @ R, axle)
        return accelerations

    def solve(self, m: Any, brake: Array) -> Answer:
        """Accelerations of a MOTION record, whose corner wrenches act on the wheels.

        `brake` (4,) is the torque of each wheel on its carrier. The motion obeys
        J' M J z'' = J' (force - bias - M free).
        """
        model, data = self.model, self.data
        J, free = self._place(m)
        self._update()
        R = data.body("sprung").xmat.reshape(3, 3).copy()
        axle = np.array([data.body(b).xmat.reshape(3, 3)[:, 1] for b in self._bodies("wheel")]) @ R
        v, rate = self._carrier_velocities(R)
        for i in range(4):
            data.qvel[self._columns(i).stop] = m["spin"][i] - axle[i] @ rate[i]
        self._update()
        M, bias = self._mass(), np.zeros(model.nv)
        mujoco.mj_rne(model, data, 0, bias)
        force = J.T @ (self._applied(m, R, brake) - bias - M @ free)
        force[6:10] += m["spring_force"] + m["damper_force"]
        unknown: Array = np.linalg.solve(J.T @ M @ J, force).astype(np.float64)
        return Answer(
            acceleration=R.T @ unknown[:3],
            angular_acceleration=unknown[3:6],
            travel_acceleration=unknown[6:10],
            spin_acceleration=self._spin_accelerations(R, J @ unknown + free, axle),
            kinetic_energy=float(data.qvel @ M @ data.qvel) / 2,
            r=(data.xipos[self._bodies("wheel")] - data.body("sprung").xpos) @ R,
            v=v,
            rate=rate,
            axle=axle,
        )
