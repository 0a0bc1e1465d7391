"""Ride figures of a run: comfort at the seat, deflection, dynamic tyre load, attitude, dampers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.comfort import WD, WK, vibration_dose, weighted_rms

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Ride:
    """What a ride is judged by; NaN where the vehicle has no such signal.

    seat (n, 3) [m/s2], travel (n, 4) [m], load (n, 4) [N], attitude (n, 2) roll and pitch [rad],
    damper_force (n, 4) [N] against extension and damper_speed (n, 4) [m/s] in extension.
    """

    seat: Array
    travel: Array
    load: Array
    attitude: Array
    damper_force: Array
    damper_speed: Array


def ride_figures(ride: Ride, rate_hz: float) -> dict[str, float]:
    """Return the figures of a ride by name; those whose signals the vehicle lacks are left out.

    weighted_acceleration_m_s2: vibration total value at the seat, ISO 2631-1 clause 6.5 with k = 1
    (comfort, clause 8.2), weighted_vertical_m_s2 its vertical part; vibration_dose_m_s1_75: dose
    values of the three axes, added as fourth powers (BS 6841). deflection_rms_m and
    tyre_load_rms_n: rms about each wheel's mean, over all wheels. roll_, pitch_rms_deg: about the
    mean, roll_, pitch_rate_rms_deg_s: of their derivatives. damper_energy_j: what the four dampers
    took out of the motion. Empty with less than two seconds, or without seat, travel or load.
    """
    needed = np.hstack([ride.seat, ride.travel, ride.load])
    if len(needed) < 2 * rate_hz or not np.isfinite(needed).all():
        return {}
    found = {
        **_comfort(ride.seat, rate_hz),
        "deflection_rms_m": _about_the_mean(ride.travel),
        "tyre_load_rms_n": _about_the_mean(ride.load),
    }
    if np.isfinite(ride.attitude).all():
        found |= _attitude(np.degrees(ride.attitude), rate_hz)
    power = ride.damper_force * ride.damper_speed
    if np.isfinite(power).all():
        found["damper_energy_j"] = float(np.trapezoid(power, dx=1 / rate_hz, axis=0).sum())
    return found


def _comfort(seat: Array, rate_hz: float) -> dict[str, float]:
    axes = [(seat[:, axis], weighting, rate_hz) for axis, weighting in enumerate((WD, WD, WK))]
    weighted = [weighted_rms(*axis) for axis in axes]
    doses = [vibration_dose(*axis) for axis in axes]
    return {
        "weighted_acceleration_m_s2": float(np.sqrt(np.square(weighted).sum())),
        "weighted_vertical_m_s2": weighted[2],
        "vibration_dose_m_s1_75": float(np.sum(np.power(doses, 4)) ** 0.25),
    }


def _attitude(degrees: Array, rate_hz: float) -> dict[str, float]:
    rates = np.gradient(degrees, 1 / rate_hz, axis=0)
    found = {}
    for i, name in enumerate(("roll", "pitch")):
        found[f"{name}_rms_deg"] = _about_the_mean(degrees[:, [i]])
        found[f"{name}_rate_rms_deg_s"] = _about_the_mean(rates[:, [i]])
    return found


def _about_the_mean(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values - values.mean(axis=0)))))
