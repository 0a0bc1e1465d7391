"""CommonRoad's multi-body car with this car's parameters, as far as they map: a second opinion.

Althoff and Wuersching, "CommonRoad: Vehicle Models" (2020), after the US DOT's VDANL: a sprung body
on two axles that roll, 29 states, Magic Formula at the nominal load. It has no tyre relaxation, no
load dependence of the tyre's coefficients, no aligning moment, a rigid rack, and no bump or roll
steer. `REDUCED` takes the same out of the FMU.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from mujoco_tree import sprung_body
from plant_probe import table_values
from scipy.integrate import solve_ivp
from vehicle_rig import (
    CENTRED,
    NO_DRAG,
    Array,
    each,
    linear_dampers,
    parameter,
)
from vehiclemodels.init_mb import init_mb
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

from cosim.fmi import Value

DAMPING = (2450.0, 3250.0)
YAW_RATE, ROLL, LATERAL, FORWARD = 5, 6, 10, 3  # of its states
LOAD_SHARE = 50.0  # PKY2 far above the loads: stiffness grows in proportion to the load
RIGID_RACK = {"Steer.Stiffness": 2e5, "Steer.Damping": 400.0, "Steer.Ackermann": 0.0}


def cornering_coefficient() -> float:
    """Cornering stiffness over load at the nominal load [1/rad], negative."""
    angle = 2.0 * np.arctan(1.0 / parameter("Tire.PKY2"))
    return float(parameter("Tire.PKY1") * np.sin(angle))


def reduced() -> dict[str, Value]:
    """Start values of the FMU without what CommonRoad's car does not have."""
    zero = ("Kin.LateralForceSteer@", "Kin.BumpSteer@", "Kin.Caster@", "Kin.KnucklePitch@")
    start: dict[str, Value] = {**NO_DRAG, **CENTRED, **RIGID_RACK, **linear_dampers(*DAMPING)}
    for name in (*zero, "Kin.Recession@", "Kin.RecessionCurve@", "Kin.CamberCurve@"):
        start |= each(name, 0.0)
    start |= {f"Tire.{n}": 0.0 for n in ("PKY3", "PDY2", "PDY3", "PEY2", "PEY3", "PEY4", "QDZ1")}
    slope = 0.5 * LOAD_SHARE * cornering_coefficient()
    # relaxation as short as the step allows
    short: dict[str, Value] = {"Tire.PTY1": 0.2, "Solver.Step": 5e-4}
    return start | short | {"Tire.PKY1": slope, "Tire.PKY2": LOAD_SHARE}


def tyre() -> SimpleNamespace:
    """The tyre's coefficients by CommonRoad's names."""
    names = ("PCX1", "PDX1", "PEX1", "PKX1", "PCY1", "PDY1", "PEY1")
    weights = ("RBX1", "RBX2", "RCX1", "RHX1", "RBY1", "RBY2", "RBY3", "RCY1", "REY1")
    values = {f"p_{n.lower()[1:]}": parameter(f"Tire.{n}") for n in names}
    values |= {f"r_{n.lower()[1:]}": parameter(f"Tire.{n}") for n in weights}
    zero = ("p_dx3", "p_hx1", "p_vx1", "p_dy3", "p_hy1", "p_hy3", "p_vy1", "p_vy3", "r_hy1")
    values |= dict.fromkeys((*zero, *(f"r_vy{k}" for k in (1, 3, 4, 5, 6))), 0.0)
    values["r_ex1"] = min(parameter("Tire.REX1"), 1.0)
    values["p_dy1"] *= parameter("Tire.FrictionY")
    values["p_ky1"] = cornering_coefficient()
    return SimpleNamespace(**values)


def car() -> Any:
    """The parameters by CommonRoad's names; left and right alike."""
    table = {**table_values(), **{n: float(v) for n, v in CENTRED.items()}}
    body, unsprung = sprung_body(table), parameter("Body.UnsprungMass") / 2.0
    track, a, b = 1.625, parameter("Body.CogToFront"), parameter("Body.CogToRear")
    axle = unsprung * track**2 / 4.0 + 2.0 * parameter("Wheel.CarrierInertiaX")
    height = parameter("Body.CogHeight")
    steering = SimpleNamespace(min=-0.6, max=0.6, v_min=-1.0, v_max=1.0)
    longitudinal = SimpleNamespace(v_min=-10.0, v_max=60.0, v_switch=30.0, a_max=10.0)
    return SimpleNamespace(
        m=parameter("Body.Mass"), m_s=body.mass, m_uf=unsprung, m_ur=unsprung,
        a=a - body.cog[0], b=b + body.cog[0], I_Phi_s=body.inertia[0], I_y_s=body.inertia[1],
        I_z=parameter("Body.InertiaYaw"), I_xz_s=0.0,
        K_sf=parameter("Susp.WheelRateFL"), K_sdf=DAMPING[0],
        K_sr=parameter("Susp.WheelRateRL"), K_sdr=DAMPING[1], T_f=track, T_r=track,
        K_ras=2e6, K_rad=2e4,  # the joint of body and axle: stiff, as in the FMU
        K_tsf=-parameter("Susp.AntiRollFront"), K_tsr=-parameter("Susp.AntiRollRear"),
        K_zt=parameter("Tire.Stiffness"), h_cg=height, h_s=height + body.cog[2],
        h_raf=parameter("Kin.RollCentreFL"), h_rar=parameter("Kin.RollCentreRL"),
        I_uf=axle, I_ur=axle, I_y_w=parameter("Wheel.Inertia"), K_lt=0.0, R_w=0.343,
        T_sb=0.65, T_se=0.5, D_f=-parameter("Kin.CamberFL"), D_r=-parameter("Kin.CamberRL"),
        E_f=0.0, E_r=0.0, tire=tyre(), steering=steering, longitudinal=longitudinal,
    )  # fmt: skip


def step_steer(speed: float, angle: float, rate: float, t: Array) -> Array:
    """Its 29 states over t (n,) when the front wheels turn to `angle` at `rate` [rad/s] from 0."""
    p = car()
    start = init_mb([0.0, 0.0, 0.0, speed, 0.0, 0.0, 0.0], p)

    def flow(time: float, x: Array) -> Any:
        return vehicle_dynamics_mb(x, [rate if time < angle / rate else 0.0, 0.0], p)

    corner = angle / rate
    first = solve_ivp(
        flow, (0.0, corner), start, "LSODA", t[t <= corner], rtol=1e-6, atol=1e-7, max_step=0.02
    )
    last = solve_ivp(
        flow, (0.0, corner), start, "LSODA", [corner], rtol=1e-6, atol=1e-7, max_step=0.02
    )
    rest = solve_ivp(
        flow, (corner, t[-1]), last.y[:, -1], "LSODA", t[t > corner], rtol=1e-6, atol=1e-7
    )
    return np.asarray(np.hstack([first.y, rest.y]).T)
